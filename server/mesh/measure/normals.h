// Normals at the vertices of a surface mesh, for shading.
#pragma once

#include "server/mesh/buffer.h"
#include "server/mesh/context.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh {

// The triangle's outward normal; its length is twice the area.
Vec3 area_normal(const Mesh& mesh, const Triangle& triangle);

// The vector scaled to length 1, or (0, 0, 1) if its length is 0.
Vec3 unit(const Vec3& v);

// Writes the unit normal of each vertex: mesh.normals, or the mean of its triangles' outward
// normals weighted by their areas, or (0, 0, 1) if that mean has no direction. The result does not
// depend on the number of threads. The memory of `normals` is reused. Throws Error kCancelled.
void vertex_normals(const Mesh& mesh, const Context& context, Buffer<Vec3>& normals);

}  // namespace isomesh::mesh
