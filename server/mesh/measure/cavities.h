// Cavities of a surface: hollows that no opening leads to.
#pragma once

#include "server/mesh/context.h"
#include "server/mesh/mesh.h"
#include "server/mesh/topology/components.h"

namespace isomesh::mesh {

// Leaves out the walls of all cavities, and what floats in them, in place: of a closed surface the
// outermost shells are left, and what was hollow is solid. A cavity's wall is a closed component
// that encloses a negative volume; components with a boundary stay. `mesh` is oriented, and does
// not run through itself. Vertices and triangles keep their order and their layers. Takes some 40
// bytes for each triangle of such walls. The same for any number of threads. Throws Error
// kUnusableVolume where a position is not a finite number, kTooLarge as TriangleGrid, and
// kCancelled, before anything is changed.
Dropped fill_cavities(const Context& context, Mesh& mesh);

}  // namespace isomesh::mesh
