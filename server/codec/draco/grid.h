// The grid that positions are quantised on.
#pragma once

#include <cstddef>

#include "server/mesh/mesh.h"

namespace isomesh::codec {

// A cube, in millimetres: a mesh's lowest corner and its longest side, in 2^bits - 1 steps along
// each axis. A position on it decodes to the same bits in every stream that uses the grid.
struct Grid {
  mesh::Vec3 low = {0, 0, 0};
  float side = 0;
  int bits = 14;  // 1..30

  // What a coordinate along an axis becomes by encoding and decoding.
  float decoded(float coordinate, std::size_t axis) const;
};

// Covers the mesh, to a millionth of a millimetre; of an empty one, the point 0. Throws Error
// kUnusableVolume where a position is not a finite number, or the mesh is too large for one.
Grid grid_of(const mesh::Mesh& mesh, int bits);

}  // namespace isomesh::codec
