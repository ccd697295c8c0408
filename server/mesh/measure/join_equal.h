// Vertices at the same place as one.
#pragma once

#include <span>

#include "server/mesh/mesh.h"

namespace isomesh::mesh {

// Lets all triangles name the same vertex where several are at the same place: the one with the
// lowest number of those that they name. Other positions are not read, and may be indeterminate.
// Takes 9 bytes for each position.
void join_equal(std::span<const Vec3> positions, std::span<Triangle> triangles);

}  // namespace isomesh::mesh
