// Exact intersection of two triangles of a surface; private to this folder.
#pragma once

#include <span>

#include "server/mesh/mesh.h"

namespace isomesh::mesh {

// True if three positions are on one line, exactly.
bool is_flat(std::span<const Vec3> positions, const Triangle& triangle);

// True if the triangles intersect as self_intersections.h defines it. The result means nothing if
// one of them is flat. Thread safe.
bool do_intersect(std::span<const Vec3> positions, const Triangle& a, const Triangle& b);

}  // namespace isomesh::mesh
