// Copies of surfaces, and coarser levels of detail. Private to this folder.
#pragma once

#include <cstdint>

#include "server/codec/space.h"
#include "server/mesh/context.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/mesh.h"

namespace isomesh::codec {

mesh::Mesh copy_of(const mesh::Mesh& mesh);
mesh::SeparatingSurface copy_of(const mesh::SeparatingSurface& walls);

// For encoders that take whole meshes: calls use(mesh) with the mesh in that space, which is a copy
// unless it is LPS.
template <class Use>
auto use_in_space(const mesh::Mesh& mesh, Space space, Use use) {
  if (space == Space::kLps) return use(mesh);
  mesh::Mesh turned = copy_of(mesh);
  for (mesh::Vec3& position : turned.positions) position = in_space(position, space);
  turned.reach = in_space(mesh.reach, space);
  return use(turned);
}

// Simplifies the mesh in place to about that many triangles, without an error bound
// (server/mesh/collapse/simplify.h). More remain if its boundary or junction curves require them.
// Needs the memory of simplification. Throws Error kCancelled.
void coarsen(std::uint64_t triangles, const mesh::Context& context, mesh::Mesh& mesh);

// As above for walls between labels: adjacent labels still share their walls.
void coarsen(std::uint64_t triangles, const mesh::Context& context, mesh::SeparatingSurface& walls);

}  // namespace isomesh::codec
