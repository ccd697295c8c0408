// Where a surface runs through itself, which no printer knows what to do with.
#pragma once

#include <cstdint>
#include <vector>

#include "server/mesh/context.h"
#include "server/mesh/measure/surface_view.h"
#include "server/mesh/points.h"

namespace isomesh::mesh {

// Two triangles that intersect, `first` the lower number.
struct IntersectingPair {
  std::uint32_t first = 0;
  std::uint32_t second = 0;
  Point place = {0, 0, 0};  // the middle of what their bounds have in common

  bool operator==(const IntersectingPair&) const = default;
};

struct SelfIntersections {
  static constexpr std::size_t kMostPlaces = 100;

  std::uint64_t pairs = 0;
  std::uint64_t triangles = 0;           // that intersect any other
  std::vector<IntersectingPair> places;  // of the first pairs by their numbers
};

// Decides with exact predicates, on the positions as they are. Two triangles intersect when they
// have a point in common beyond what they share by their indices:
//  * without a common vertex, any point, also a mere touch, or where they overlap in one plane;
//  * with one, any other point;
//  * with an edge in common, where they lie in one plane, to the same side of it.
// Two that name the same three vertices intersect. Triangles without area are passed over: they are
// lines, and what those would touch is no wall. Vertices at the same place with other numbers are
// others.
//
// Same for any number of threads. Takes what TriangleGrid takes, and 16 bytes a pair. Throws Error
// kUnusableVolume where a position is not a finite number, kTooLarge as TriangleGrid, and
// kCancelled.
SelfIntersections find_self_intersections(const SurfaceView& surface, const Context& context);

}  // namespace isomesh::mesh
