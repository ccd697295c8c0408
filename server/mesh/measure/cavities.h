// Cavities of a surface: hollows that no opening leads to.
#pragma once

#include <cstdint>

#include "server/mesh/context.h"
#include "server/mesh/mesh.h"
#include "server/mesh/topology/components.h"

namespace isomesh::mesh {

// Removes the walls of all cavities, and what floats in them, in place. Of a closed surface the
// outermost shells remain, so what was hollow becomes solid. A cavity's wall is a closed component
// that encloses a negative volume; components with a boundary stay. `mesh` must be oriented and
// must not intersect itself. Vertices and triangles keep their order and their layers. The result
// does not depend on the number of threads.
// Throws Error kUnusableVolume for a position that is not finite, kTooLarge as TriangleGrid, and
// kCancelled, before anything is changed.
Dropped fill_cavities(const Context& context, Mesh& mesh);

// An upper bound of the memory that it takes beside a mesh of that size, in bytes: all triangles
// may be walls of cavities.
std::uint64_t filling_memory(std::uint64_t vertices, std::uint64_t triangles);

}  // namespace isomesh::mesh
