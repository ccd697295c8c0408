// Edge collapses that keep T+ inside S and T- outside; private to this folder.
//
// Quadrics decide which edges go first (M. Garland, P. S. Heckbert, "Surface simplification using
// quadric error metrics", SIGGRAPH 1997). They prove nothing: only the signs of F on the new
// triangles of T+ and T- decide whether an edge may go.
#pragma once

#include <cstdint>

#include "server/mesh/collapse/collapse_block.h"
#include "server/mesh/collapse/tube.h"
#include "server/mesh/context.h"

namespace isomesh::mesh::collapse {

// Removes triangles of `tube` until there are `least`, 0: as few as may be; vertices that none
// names stay, unused. Those of the border are not moved. No new triangle is a needle or lies on its
// back. The same for any number of threads. Throws Error kCancelled.
void collapse_edges(const CollapseSurroundings& around, std::uint64_t least, const Context& context,
                    Tube& tube);

}  // namespace isomesh::mesh::collapse
