// Coarser levels of detail. Private to this folder.
#pragma once

#include <cstdint>

#include "server/mesh/context.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/mesh.h"

namespace isomesh::codec {

mesh::Mesh copy_of(const mesh::Mesh& mesh);
mesh::SeparatingSurface copy_of(const mesh::SeparatingSurface& walls);

// Simplifies the mesh in place to about that many triangles, without an error bound
// (server/mesh/simplify/simplify.h). More remain if its boundary or junction curves require them.
// Needs the memory of simplification. Throws Error kCancelled.
void coarsen(std::uint64_t triangles, const mesh::Context& context, mesh::Mesh& mesh);

// As above for walls between labels: adjacent labels still share their walls.
void coarsen(std::uint64_t triangles, const mesh::Context& context, mesh::SeparatingSurface& walls);

// A context for a part of the progress. `context` must outlive it.
mesh::Context portion_of(const mesh::Context& context, double begin, double end);

}  // namespace isomesh::codec
