// Positions as numbers of steps on the grid; private to this folder.
#pragma once

#include <cstdint>
#include <span>

#include "server/codec/draco/grid.h"
#include "server/mesh/mesh.h"

namespace isomesh::codec::edgebreaker {

// A position on the grid. The fourth value is zero: rows of eight bytes are read at once.
struct alignas(8) GridPoint {
  std::uint16_t x, y, z, zero;
};

// The least and the greatest coordinate on any axis.
struct Extent {
  std::int32_t least = 0;
  std::int32_t greatest = 0;

  void cover(const Extent& other);
};

// Writes one point for each position; as libdraco rounds them. Returns false where one is not on
// the grid, or is not a number. `points` has room for all.
bool quantise(std::span<const mesh::Vec3> positions, const Grid& grid, GridPoint* points,
              Extent& extent);

}  // namespace isomesh::codec::edgebreaker
