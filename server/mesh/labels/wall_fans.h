// The triangles around every vertex of the walls between labels, each wall's by themselves.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "server/mesh/buffer.h"
#include "server/mesh/context.h"
#include "server/mesh/labels/rings.h"
#include "server/mesh/labels/separate.h"

namespace isomesh::mesh {

// The two corners of a triangle that follow a vertex, counter-clockwise.
struct Spoke {
  std::uint32_t next = 0;
  std::uint32_t previous = 0;
};

// A wall as a vertex sees it: between two parts (label_parts.h), or a cap of one.
struct Wall {
  WallSides sides;
  bool is_cap = false;

  bool operator==(const Wall&) const = default;
};

// A fan is a vertex and one of the walls that meet there; fans are numbered by vertex, so those of
// a vertex follow each other. Immutable, so safe to read from several threads.
class WallFans {
 public:
  static constexpr std::uint32_t kNone = UINT32_MAX;

  WallFans() = default;

  // `is_cap` tells triangles of caps, which make walls of their own; it is called from several
  // threads. `surface` need not outlive this. Throws Error kCancelled, and kTooLarge when 31 bits
  // cannot number all fans.
  WallFans(const SeparatingSurface& surface, const std::function<bool(const Triangle&)>& is_cap,
           const Context& context);

  std::size_t size() const { return vertex_.size(); }
  std::uint32_t vertex(std::size_t fan) const { return vertex_[fan]; }
  const Wall& wall(std::size_t fan) const { return walls_[fan]; }

  // The fans of a vertex: [begin(vertex), begin(vertex + 1)).
  std::uint32_t begin(std::size_t vertex) const { return first_[vertex]; }

  // The fan of that vertex and wall, or kNone.
  std::uint32_t find(std::size_t vertex, const Wall& wall) const;

  // One for each of its triangles, in the surface's order.
  std::span<const Spoke> spokes(std::size_t fan) const {
    return spokes_.span().subspan(spokes_begin_[fan], spokes_begin_[fan + 1] - spokes_begin_[fan]);
  }

  // By fan, those of the same wall at the vertices that its triangles join it with.
  const Rings& neighbors() const { return neighbors_; }

  // An upper estimate of the memory for a surface of that size.
  static std::uint64_t bytes(std::uint64_t vertices, std::uint64_t triangles);

 private:
  void find_neighbors(const Context& context);

  Buffer<std::uint32_t> first_;   // of each vertex, and all
  Buffer<std::uint32_t> vertex_;  // of each fan
  Buffer<Wall> walls_;
  Buffer<std::uint64_t> spokes_begin_;
  Buffer<Spoke> spokes_;
  Rings neighbors_;
};

}  // namespace isomesh::mesh
