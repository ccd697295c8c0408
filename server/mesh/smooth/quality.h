// Smoothing that enlarges the angles of triangles and keeps the surface; private to this folder.
//
// A vertex moves in the tangent plane of the triangles around it, which keeps the enclosed volume.
// If that leads away from the extracted surface, it is put back onto it. The goal of a move is
//  * kTangentialMean: the mean of its neighbours;
//  * kBisectors: each edge to a neighbour is turned onto the bisector of the neighbour's angle,
//    narrow angles first (T. Zhou, K. Shimada, "An angle-based approach to two-dimensional mesh
//    smoothing", 9th International Meshing Roundtable, 2000);
//  * kLargestAngle: only if an angle around it is below 25 degrees, the best of that mean, the
//    place by bisectors, and a climb along the gradients of the smallest angles (L. A. Freitag, "On
//    combining Laplacian and optimization-based mesh smoothing techniques", AMD Trends in
//    Unstructured Mesh Generation 220, 1997).
//
// Each move sees the moves before it (Gauss-Seidel). Their order does not depend on the number of
// threads: first the even slabs of four layers, then the odd ones, so no two neighbouring slabs are
// worked on at once; within a slab colour by colour, where no edge joins two vertices of one
// colour.
#pragma once

#include <cstdint>

#include "server/mesh/context.h"
#include "server/mesh/extract/extract.h"
#include "server/mesh/mesh.h"
#include "server/mesh/smooth/smooth.h"

namespace isomesh::mesh {

// Smooths the mesh in place. Holds the vertices that `smooth` holds, vertices on junction curves,
// and those with more than 32 neighbours. No move turns a triangle over, takes its area, or cuts
// off a tip or an edge by more than a tenth of the lengths around it. The result does not depend on
// the number of threads or the processor. Needs at least one step and one vertex. Throws Error
// kCancelled; the positions are indeterminate then.
SmoothingEffect smooth_by_quality(const SmoothOptions& options, const Context& context, Mesh& mesh);

// An upper bound of the memory that smooth_by_quality takes beside the mesh, in bytes.
std::uint64_t quality_memory(const SurfaceSize& size);

}  // namespace isomesh::mesh
