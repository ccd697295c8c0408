// Self-intersections of a surface. Printers cannot print such places.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "server/mesh/context.h"
#include "server/mesh/measure/surface_view.h"
#include "server/mesh/points.h"

namespace isomesh::mesh {

// Two intersecting triangles; `first` is the lower number.
struct IntersectingPair {
  std::uint32_t first = 0;
  std::uint32_t second = 0;
  Point place = {0, 0, 0};  // the middle of their bounds' intersection

  bool operator==(const IntersectingPair&) const = default;
};

struct SelfIntersections {
  static constexpr std::size_t kMostPlaces = 100;

  std::uint64_t pairs = 0;
  std::uint64_t triangles = 0;           // those that intersect another one
  std::vector<IntersectingPair> places;  // the first pairs, by their numbers: `most_places`
};

// Decides with exact predicates on the stored positions. Two triangles intersect if they have a
// point in common beyond what they share by their indices:
//  * without a common vertex: any point, also if they only touch or overlap in one plane;
//  * with one common vertex: any other point;
//  * with a common edge: if they lie in one plane on the same side of it.
// Triangles that name the same three vertices intersect. Triangles without area are skipped: they
// are lines and no walls. Vertices at the same place with different numbers are different.
//
// Does not depend on the number of threads. Takes the memory of TriangleGrid, and 32 bytes a pair.
// Throws Error kUnusableVolume for a position that is not finite, kTooLarge as TriangleGrid, and
// kCancelled.
SelfIntersections find_self_intersections(const SurfaceView& surface, const Context& context,
                                          std::size_t most_places = SelfIntersections::kMostPlaces);

}  // namespace isomesh::mesh
