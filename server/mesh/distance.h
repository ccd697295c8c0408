// How far two surfaces are from each other: the certificate of a mesh.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "server/mesh/buffer.h"
#include "server/mesh/context.h"
#include "server/mesh/surface_view.h"
#include "server/mesh/triangle_grid.h"

namespace isomesh::mesh {

// Distances from points of one surface, its vertices and the centres of its triangles, to the
// nearest points of another one's triangles. Exact, in double precision, but kept in single.
struct DistanceSummary {
  static constexpr std::size_t kBins = 20;

  std::uint64_t points = 0;
  double max_mm = 0;
  double mean_mm = 0;
  double rms_mm = 0;
  double p99_mm = 0;  // 99 of 100 points are this near: the smallest distance that is one of them
  std::array<std::uint64_t, kBins> histogram = {};  // points, in equal bins from zero to max_mm

  bool operator==(const DistanceSummary&) const = default;
};

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
