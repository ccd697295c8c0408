// Cavities of a surface: hollows that no opening leads to.
#pragma once

#include "server/mesh/context.h"
#include "server/mesh/mesh.h"
#include "server/mesh/topology/components.h"

namespace isomesh::mesh {

// Removes the walls of all cavities, and what floats in them, in place. Of a closed surface the
// outermost shells remain, so what was hollow becomes solid. A cavity's wall is a closed component
// that encloses a negative volume; components with a boundary stay. `mesh` must be oriented and
// must not intersect itself. Vertices and triangles keep their order and their layers. Takes some
// 40 bytes for each triangle of such walls. The result does not depend on the number of threads.
// Throws Error kUnusableVolume for a position that is not finite, kTooLarge as TriangleGrid, and
// kCancelled, before anything is changed.
Dropped fill_cavities(const Context& context, Mesh& mesh);

}  // namespace isomesh::mesh
