// Laplacian smoothing of a surface mesh.
#pragma once

#include <cstdint>

#include "server/mesh/buffer.h"
#include "server/mesh/context.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh {

// Which vertices each vertex is joined to by an edge, as compressed lists: the neighbours of v are
// neighbors[offsets[v] .. offsets[v + 1]). A vertex on the boundary or, of a closed surface, on the
// border of the volume has an empty list: smoothing keeps it where it is, so caps stay flat, and
// closing a surface does not change how the rest of it is smoothed.
struct Connectivity {
  Buffer<std::uint32_t> offsets;  // vertices + 1
  Buffer<std::uint32_t> neighbors;
};

// Builds the lists from the triangles of an oriented manifold; deterministic. `connectivity`'s
// memory is reused. Throws Error kCancelled.
void build_connectivity(const Mesh& mesh, const Context& context, Connectivity& connectivity);

struct SmoothOptions {
  int passes = 5;
  double lambda = 1;  // (0, 1]: the share of the way to the mean of the neighbours
};

// Moves every vertex that is not on the boundary by `lambda` towards the mean of its neighbours,
// `passes` times (the paper's section 3). All vertices of a pass move from the positions of the
// last one, so the result depends neither on their order nor on the number of threads. `scratch`
// holds the other half of the positions; its memory is reused. Throws Error kCancelled.
void smooth_laplacian(const Connectivity& connectivity, const SmoothOptions& options,
                      const Context& context, Mesh& mesh, Buffer<Vec3>& scratch);

}  // namespace isomesh::mesh
