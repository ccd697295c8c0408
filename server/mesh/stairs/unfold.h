// Straightens triangles that fold over; private to this folder.
#pragma once

#include <cstddef>

#include "server/mesh/stairs/wall_shape.h"

namespace isomesh::mesh {

// Moves the corners of triangles that lie against their wall's mean normal towards their
// neighbours' mean, and those that resist back to where they were extracted. Throws Error
// kCancelled.
void unfold(const Context& context, WallShape& shape);

// How many triangles point against the mean normal of their wall around them. Throws Error
// kCancelled.
std::size_t count_folded(const WallShape& shape, const Context& context);

}  // namespace isomesh::mesh
