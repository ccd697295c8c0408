// Smoothing that makes the angles of triangles larger and leaves the surface where it is; private
// to this folder.
//
// A vertex moves in the tangent plane of the triangles around it, which keeps the enclosed volume.
// If that leads away from the surface as it was extracted, it is put back. Where it moves to:
//  * angle: each edge to a neighbour is turned onto the bisector of the neighbour's angle, narrow
//    angles first (T. Zhou, K. Shimada, "An angle-based approach to two-dimensional mesh
//    smoothing", 9th International Meshing Roundtable, 2000);
//  * optimize: in the first half of the passes to the mean of its neighbours; in the rest, if an
//    angle around it is below 25 degrees, to whichever raises the smallest one: that mean, the
//    place by bisectors, or a climb along the gradients of the smallest angles (L. A. Freitag, "On
//    combining Laplacian and optimization-based mesh smoothing techniques", AMD Trends in
//    Unstructured Mesh Generation 220, 1997).
//
// A move sees those before it (Gauss-Seidel), in an order that no number of threads changes: slabs
// of four layers, first the even ones and then the odd ones, so that no two that are worked on at
// once are neighbours; within a slab colour by colour, where no edge joins two vertices of one
// colour.
#pragma once

#include <cstdint>

#include "server/mesh/context.h"
#include "server/mesh/extract/extract.h"
#include "server/mesh/mesh.h"
#include "server/mesh/smooth/smooth.h"

namespace isomesh::mesh {

// Smooths the mesh in place; as `smooth`, with the same vertices fixed, and junction curves and
// vertices of more than 32 neighbours, too. No move turns a triangle over, takes its area, or cuts
// off a tip or an edge by more than a tenth of the lengths around it. The result is the same to the
// byte for any number of threads and on every processor. At least one pass and one vertex. Throws
// Error kCancelled; the positions are indeterminate then.
SmoothingEffect smooth_by_quality(const SmoothOptions& options, const Context& context, Mesh& mesh);

// An upper bound of what smooth_by_quality takes beside the mesh, in bytes.
std::uint64_t quality_memory(const SurfaceSize& size);

}  // namespace isomesh::mesh
