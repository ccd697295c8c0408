// The triangles of a surface that are near some points; private to the kernels.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/mesh/context.h"
#include "server/mesh/measure/surface_view.h"
#include "server/mesh/points.h"

namespace isomesh::mesh {

// All triangles that are within `reach_mm` of one of the points, and some others near them, in
// their order. Points must be finite. Takes up to 16 MiB beside them. Does not depend on the number
// of threads. Throws Error kCancelled.
std::vector<Triangle> triangles_near(std::span<const Point> points, double reach_mm,
                                     const SurfaceView& surface, const Context& context);

}  // namespace isomesh::mesh
