// Coarser levels of detail; private to this folder.
#pragma once

#include <cstdint>

#include "server/mesh/context.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/mesh.h"

namespace isomesh::codec {

mesh::Mesh copy_of(const mesh::Mesh& mesh);
mesh::SeparatingSurface copy_of(const mesh::SeparatingSurface& walls);

// Simplifies the mesh in place to about so many triangles, without a bound of the error
// (server/mesh/simplify/simplify.h); to more where its boundary, or the lines between walls, leave
// no choice. Takes what simplification takes. Throws Error kCancelled.
void coarsen(std::uint64_t triangles, const mesh::Context& context, mesh::Mesh& mesh);

// As above for walls between labels: labels next to each other still have theirs in common.
void coarsen(std::uint64_t triangles, const mesh::Context& context, mesh::SeparatingSurface& walls);

// A part of what the context's progress tells. The context has to outlive it.
mesh::Context portion_of(const mesh::Context& context, double begin, double end);

}  // namespace isomesh::codec
