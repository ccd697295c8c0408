// The thickness of walls. Printers cannot print walls that are thinner than their nozzle is wide.
#pragma once

#include "proto/mesh_summary.h"
#include "server/mesh/context.h"
#include "server/mesh/measure/surface_view.h"

namespace isomesh::mesh {

// The thickness at a point of the surface is the length of the ray from it, against its triangle's
// normal, to where the ray leaves the material (the ray method: B. Sinha, "Efficient wall thickness
// analysis methods for optimal design of cast parts", 2007). Unlike the largest ball that touches
// the surface in the point, it does not vanish near the edges of a cube. It counts only if what it
// meets there faces away from the point, within 60 degrees: other ends are no opposite side. Two
// bodies are no wall, nor is the gap between two walls, because a ray ends where the material does.
// An edge is no wall either: nearer than `below_mm` to a corner or an edge that both triangles
// have, there is no thickness. Rough surfaces have edges of any angle, which would hide thin walls.
//
// Points are the centres of triangles. Triangles that are larger than `below_mm` are divided, so
// that there are about a million points more in surfaces of `area_mm2` together, at most. What is
// narrower than these parts may be missed.
//
// Does not depend on the number of threads. Takes the memory of TriangleGrid. Throws Error
// kUnusableVolume for a position that is not finite, kTooLarge as TriangleGrid, and kCancelled.
Thickness measure_thickness(const SurfaceView& surface, double below_mm, double area_mm2,
                            const Context& context);

}  // namespace isomesh::mesh
