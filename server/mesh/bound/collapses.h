// Edge collapses that keep T+ inside S and T- outside; private to this folder.
//
// Which edges go first is told by quadrics (M. Garland, P. S. Heckbert, "Surface simplification
// using quadric error metrics", SIGGRAPH 1997). They prove nothing: whether one may go is decided
// by the signs of F on the new triangles of T+ and T- alone.
#pragma once

#include <cstdint>

#include "server/mesh/bound/field.h"
#include "server/mesh/bound/tube.h"
#include "server/mesh/context.h"

namespace isomesh::mesh::bound {

struct CollapseOptions {
  double reach_mm = 0;          // how far T+ and T- are put from T
  std::uint64_t triangles = 0;  // enough of them gone when there are so many; 0: as few as may be
};

// Removes triangles of `tube`; vertices that none names stay, unused. Those of the border are not
// moved. No new triangle is a needle or lies on its back. The same for any number of threads.
// Throws Error kCancelled.
void collapse_edges(const Field& field, const Metric& metric, const CollapseOptions& options,
                    const Context& context, Tube& tube);

}  // namespace isomesh::mesh::bound
