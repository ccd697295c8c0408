// The triangles around every vertex of the walls between labels, each wall's by themselves.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/mesh/buffer.h"
#include "server/mesh/context.h"
#include "server/mesh/labels/neighbor_lists.h"
#include "server/mesh/labels/separate.h"

namespace isomesh::mesh {

// A wall as a vertex sees it: between two parts (label_parts.h), or a cap of one.
struct Wall {
  WallSides sides;
  bool is_cap = false;

  auto operator<=>(const Wall&) const = default;
};

// A fan is a vertex and one of the walls that meet there; fans are numbered by vertex, so those of
// a vertex follow each other. Immutable, so safe to read from several threads.
class WallFans {
 public:
  static constexpr std::uint32_t kNone = UINT32_MAX;

  WallFans() = default;

  // `faces`: the faces of a box that each vertex is in, a bit each; triangles in one are caps,
  // which make walls of their own. Empty if there are none. Neither it nor `surface` need outlive
  // this. Throws Error kCancelled, and kTooLarge when 31 bits cannot number all fans.
  WallFans(const SeparatingSurface& surface, std::span<const std::uint8_t> faces,
           const Context& context);

  std::size_t size() const { return vertex_.size(); }
  std::uint32_t vertex(std::size_t fan) const { return vertex_[fan]; }
  const Wall& wall(std::size_t fan) const { return walls_[fan]; }

  // The fans of a vertex: [begin(vertex), begin(vertex + 1)).
  std::uint32_t begin(std::size_t vertex) const { return first_[vertex]; }

  // The fan of that vertex and wall, or kNone.
  std::uint32_t find(std::size_t vertex, const Wall& wall) const;

  // True if its triangles go around the vertex once.
  bool is_closed(std::size_t fan) const { return kinds_[fan] == Kind::kClosed; }

  // Calls add(load(a), load(b)) for the other two corners of each of its triangles, with those
  // counter-clockwise. Triangles follow each other around the vertex, so load() is called once for
  // a corner that two of them have.
  template <class Load, class Add>
  void visit_triangles(std::size_t fan, const Load& load, const Add& add) const {
    const std::uint32_t* at = ring_.data() + ring_begin_[fan];
    const std::uint32_t* const end = ring_.data() + ring_begin_[fan + 1];
    if (kinds_[fan] == Kind::kLoose) {
      for (; at != end; at += 2) add(load(at[0]), load(at[1]));
      return;
    }
    auto before = load(kinds_[fan] == Kind::kOpen ? *at++ : end[-1]);
    for (; at != end; ++at) {
      const auto here = load(*at);
      add(before, here);
      before = here;
    }
  }

  // By fan, those of the same wall at the vertices that its triangles join it with.
  const NeighborLists& neighbors() const { return neighbors_; }

  // An upper estimate of the memory for a surface of that size.
  static std::uint64_t bytes(std::uint64_t vertices, std::uint64_t triangles);

 private:
  // The numbers of its other corners: around the vertex, from one end to the other, or by triangle.
  enum class Kind : std::uint8_t { kClosed, kOpen, kLoose };
  struct Corner;
  struct Layer;

  static Layer layer_of(const SeparatingSurface& surface, std::span<const std::uint8_t> faces,
                        std::size_t layer);
  static Kind append_ring(std::span<const Corner> fan, std::vector<std::uint32_t>& ring);
  void find_neighbors(const Context& context);

  Buffer<std::uint32_t> first_;   // of each vertex, and all
  Buffer<std::uint32_t> vertex_;  // of each fan
  Buffer<Wall> walls_;
  Buffer<Kind> kinds_;
  Buffer<std::uint64_t> ring_begin_;  // of each fan, and all
  Buffer<std::uint32_t> ring_;
  NeighborLists neighbors_;
};

}  // namespace isomesh::mesh
