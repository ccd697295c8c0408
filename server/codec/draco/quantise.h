// Quantisation of positions on the grid. Private to this folder.
#pragma once

#include <cstdint>
#include <span>

#include "server/codec/draco/grid.h"
#include "server/mesh/mesh.h"

namespace isomesh::codec::edgebreaker {

// A position on the grid. The fourth value is zero, so that eight bytes can be read at once.
struct alignas(8) GridPoint {
  std::uint16_t x, y, z, zero;
};

// The smallest and the largest coordinate over all axes.
struct Extent {
  std::int32_t least = 0;
  std::int32_t greatest = 0;

  void cover(const Extent& other);
};

// Writes one point per position, rounded as libdraco does. Returns false if a position is NaN or
// off the grid. `points` has room for all.
bool quantise(std::span<const mesh::Vec3> positions, const Grid& grid, GridPoint* points,
              Extent& extent);

}  // namespace isomesh::codec::edgebreaker
