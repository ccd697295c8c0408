// Distances between two surfaces: the certificate of a mesh.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>

#include "proto/mesh_summary.h"
#include "server/mesh/buffer.h"
#include "server/mesh/context.h"
#include "server/mesh/measure/surface_view.h"
#include "server/mesh/measure/triangle_grid.h"

namespace isomesh::mesh {

// The distance of each vertex in millimetres, in the order of the positions; infinite if the other
// surface has no triangles. Does not depend on the number of threads. Throws Error kUnusableVolume
// for a position that is not finite, and kCancelled.
void measure_vertex_distances(const SurfaceView& from, const TriangleGrid& to,
                              const Context& context, Buffer<float>& distances);

inline constexpr std::size_t kAllPoints = std::numeric_limits<std::size_t>::max();

// Measures at the vertices and the centres of the triangles. If these are more than `most`, which
// is 256 at least, of every n-th run of 256, at most `most` in total. All zero without points. If
// the other surface has no triangles, the distances are infinite and the histogram is zero. Takes 4
// bytes a point. Does not depend on the number of threads. Throws as above.
DistanceSummary measure_distance(const SurfaceView& from, const TriangleGrid& to,
                                 const Context& context, std::size_t most = kAllPoints);

// Both directions: what is missing shows only from the reference, what was added only from the
// mesh.
struct Certificate {
  DistanceSummary from_mesh;
  DistanceSummary from_reference;

  double max_mm() const { return std::max(from_mesh.max_mm, from_reference.max_mm); }

  bool operator==(const Certificate&) const = default;
};

// `most`: points of each surface. Takes the memory of the larger surface's grid (triangle_grid.h)
// and 4 bytes a point. If the surfaces are within `reach_mm` of each other, few points take less
// time: then only what is near them is looked at. The result is the same. Does not depend on the
// number of threads. Throws as above, and kTooLarge.
Certificate certify(const SurfaceView& mesh, const SurfaceView& reference, const Context& context,
                    std::size_t most = kAllPoints,
                    double reach_mm = std::numeric_limits<double>::infinity());

}  // namespace isomesh::mesh
