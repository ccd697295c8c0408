// The decisions of server/mesh/measure/exact_triangles.h, made by CGAL.
#pragma once

#include <span>

#include "server/mesh/mesh.h"

namespace isomesh::test {

bool is_flat_for_cgal(std::span<const mesh::Vec3> positions, const mesh::Triangle& triangle);

// Neither of them is flat.
bool do_intersect_for_cgal(std::span<const mesh::Vec3> positions, const mesh::Triangle& a,
                           const mesh::Triangle& b);

}  // namespace isomesh::test
