// How far two surfaces are from each other: the certificate of a mesh.
#pragma once

#include <algorithm>

#include "proto/mesh_summary.h"
#include "server/mesh/buffer.h"
#include "server/mesh/context.h"
#include "server/mesh/measure/surface_view.h"
#include "server/mesh/measure/triangle_grid.h"

namespace isomesh::mesh {

// Of each vertex, in the order of the positions, in millimetres; infinite where the other surface
// has no triangles. Same for any number of threads. Throws Error kUnusableVolume where a position
// is not a finite number, and kCancelled.
void measure_vertex_distances(const SurfaceView& from, const TriangleGrid& to,
                              const Context& context, Buffer<float>& distances);

// Without points all zero; where the other surface has no triangles, the distances are infinite and
// the histogram is zero. Takes 4 bytes a point. Same for any number of threads. Throws as above.
DistanceSummary measure_distance(const SurfaceView& from, const TriangleGrid& to,
                                 const Context& context);

// Both ways: what has been left out shows from the reference's side alone, what has been added from
// the mesh's.
struct Certificate {
  DistanceSummary from_mesh;
  DistanceSummary from_reference;

  double max_mm() const { return std::max(from_mesh.max_mm, from_reference.max_mm); }

  bool operator==(const Certificate&) const = default;
};

// Takes what the larger surface's grid takes (triangle_grid.h) and 4 bytes a point. Same for any
// number of threads. Throws as above, and kTooLarge.
Certificate certify(const SurfaceView& mesh, const SurfaceView& reference, const Context& context);

}  // namespace isomesh::mesh
