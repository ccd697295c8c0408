// Checks the triangles around a vertex for being a manifold; private to the kernels.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "server/mesh/topology/topology.h"

namespace isomesh::mesh {

// A triangle as seen from one of its corners: it continues to `next` and comes from `previous`.
struct Corner {
  std::uint32_t next;
  std::uint32_t previous;
};

// Walks around vertices whose corners are one closed fan, as almost all are.
class FanWalk {
 public:
  // True if the corners are one closed fan in which every neighbour is next once and previous once.
  // May be false if that takes longer to find out.
  bool is_closed(std::span<const Corner> corners) {
    const std::size_t count = corners.size();
    if (count < 3 || count > kMostCorners) return false;
    for (std::size_t i = 0; i < count; ++i) {
      by_previous_[slot(corners[i].previous)] = static_cast<std::uint8_t>(i);
    }
    // The successor of each corner, found for all independently: four bits a corner.
    std::uint64_t following = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t found = by_previous_[slot(corners[i].next)];
      if (found >= count || corners[found].previous != corners[i].next) return false;
      following |= std::uint64_t{found} << (kBits * i);
    }
    // A walk that first returns to its start after as many steps as there are corners has visited
    // each once.
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

  // A corner for some neighbours, by a hash of their numbers; always checked before use.
  std::array<std::uint8_t, kSlots> by_previous_ = {};
};

// Adds to `topology` the edges and fans of one vertex, by definition. A boundary edge is counted at
// the vertex where it begins. Returns the number of fans.
std::size_t check_vertex(std::span<const Corner> corners, Topology& topology);

}  // namespace isomesh::mesh
