#pragma once

#include <cstddef>
#include <span>

#include "server/mesh/mesh.h"

namespace isomesh::codec {

// A cube, in millimetres: a box's lowest corner and its longest side, divided into 2^bits - 1 steps
// along each axis. A position decodes to the same bits in every stream that uses the same grid.
struct Grid {
  mesh::Vec3 low = {0, 0, 0};
  float side = 0;
  int bits = 14;  // 1..30

  // The coordinate after encoding and decoding.
  float decoded(float coordinate, std::size_t axis) const;
};

// The grid that covers the box, to a step or a millionth of a millimetre, whichever is less; the
// point 0 for an empty one. No step is too small for a normal number in single precision. Throws
// Error kUnusableVolume if the box is not finite, or too large for a grid.
Grid grid_of(const mesh::Reach& box, int bits);

// The box of the positions. Not finite if one of them is not.
mesh::Reach box_of(std::span<const mesh::Vec3> positions);

// True if the grid of a mesh in that box is its reach's.
bool is_grid_of(const mesh::Reach& reach, const mesh::Reach& box);

// The grid of the mesh's reach, so that it is known before the mesh is made; of the mesh itself if
// it is not within that, or has none.
Grid grid_of(const mesh::Mesh& mesh, int bits);

// The side of such a grid for numbers from 0 to `most`; 1 if all are 0.
float range_from_zero(float most, int bits);

}  // namespace isomesh::codec
