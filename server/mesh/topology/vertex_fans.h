// Whether the triangles around a vertex are as a manifold has them; private to this folder.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "server/mesh/topology/topology.h"

namespace isomesh::mesh {

// What a triangle looks like from one of its corners: it runs on to `next` and comes from
// `previous`.
struct Corner {
  std::uint32_t next;
  std::uint32_t previous;
};

// Walks around vertices whose corners follow each other in one closed fan, as nearly all do.
class FanWalk {
 public:
  // True when the corners are one closed fan in which every neighbour is next once and previous
  // once. False also where that was not to be found out at once.
  bool is_closed(std::span<const Corner> corners) {
    const std::size_t count = corners.size();
    if (count < 3 || count > kMostCorners) return false;
    for (std::size_t i = 0; i < count; ++i) {
      by_previous_[slot(corners[i].previous)] = static_cast<std::uint8_t>(i);
    }
    // Which corner follows each, found for all independently of each other: four bits a corner.
    std::uint64_t following = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t found = by_previous_[slot(corners[i].next)];
      if (found >= count || corners[found].previous != corners[i].next) return false;
      following |= std::uint64_t{found} << (kBits * i);
    }
    // A walk that first comes back to where it began after as many steps as there are corners has
    // been at each once.
    std::size_t at = 0;
    for (std::size_t step = 1; step < count; ++step) {
      at = following >> (kBits * at) & (kMostCorners - 1);
      if (at == 0) return false;
    }
    return (following >> (kBits * at) & (kMostCorners - 1)) == 0;
  }

 private:
  static constexpr std::size_t kBits = 4;
  static constexpr std::size_t kMostCorners = 1 << kBits;
  static constexpr std::size_t kSlots = 4096;

  static std::size_t slot(std::uint32_t vertex) { return vertex % kSlots; }

  // A corner for some neighbours by what their numbers leave; what it says is always checked.
  std::array<std::uint8_t, kSlots> by_previous_ = {};
};

// Adds to `topology` what the corners of one vertex say of its edges and its fans, by the
// definitions one by one. A boundary edge is counted at the vertex that it runs from.
void check_vertex(std::span<const Corner> corners, Topology& topology);

}  // namespace isomesh::mesh
