// The diameter of a set of points.
#pragma once

#include <span>
#include <stop_token>

#include "server/mesh/mesh.h"

namespace isomesh::mesh {

// The largest distance between two of the points, in the unit of their coordinates; 0 if they are
// fewer than two. Exact up to the rounding of doubles. Changes the order of the points.
//
// Pairs of groups of points are split until no pair can have a larger distance than the largest one
// found (Malandain and Boissonnat, Computing the diameter of a point set, 2002). The bound of a
// pair adds the extents along the line between the groups and across it, so the points of a sphere,
// which all have a partner at almost the same distance, take O(n log n) time, too. Takes about 3
// bytes a point. Throws Error kUnusableVolume for a point that is not finite, and kCancelled.
double largest_distance(std::span<Vec3> points, const std::stop_token& stop);

}  // namespace isomesh::mesh
