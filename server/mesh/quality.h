// How good a mesh is: the shapes of its triangles, and whether it is what a surface must be.
#pragma once

#include <cstdint>

#include "proto/types.h"
#include "server/mesh/context.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh {

// For each triangle, in single precision:
//  * its radius ratio, twice the radius of the inscribed circle over that of the circumscribed one:
//    1 when it is equilateral, 0 when it is flat (P. P. Pébay, T. J. Baker, "Analysis of triangle
//    quality measures", Math. Comp. 72, 2003);
//  * its smallest angle in degrees, at most 60.
struct Shapes {
  Distribution aspect_ratio;        // bins of 0.05
  Distribution smallest_angle_deg;  // bins of 3 degrees
};

// The same for any number of threads and on every processor. Throws Error kCancelled.
Shapes measure_shapes(const Mesh& mesh, const Context& context);

// What is found on the triangles alone, whoever made them; only the layers must be as mesh.h has
// them. Edges are those of the triangles.
struct Soundness {
  std::uint64_t boundary_edges = 0;  // of one triangle only
  bool manifold = true;  // at most two triangles at an edge, and one fan of them around a vertex
  bool oriented = true;  // no two triangles run through an edge in the same direction
};

// The same for any number of threads. Throws Error kCancelled.
Soundness check_soundness(const Mesh& mesh, const Context& context);

}  // namespace isomesh::mesh
