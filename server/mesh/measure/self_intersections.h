// Self-intersections of a surface. Printers cannot print such places.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
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
  std::vector<IntersectingPair> places;  // the first kMostPlaces pairs, by their numbers
};

// Decides with exact predicates on the stored positions. Two triangles intersect if they have a
// point in common beyond what they share by their indices:
//  * without a common vertex: any point, also if they only touch or overlap in one plane;
//  * with one common vertex: any other point;
//  * with a common edge: if they lie in one plane on the same side of it.
// Triangles that name the same three vertices intersect. Triangles without area are skipped: they
// are lines and no walls. Vertices at the same place with different numbers are different.
//
// Does not depend on the number of threads. Pairs are counted, not kept: takes the memory of
// TriangleGrid and some 8 bytes a triangle, however many intersect. Throws Error kUnusableVolume
// for a position that is not finite, kTooLarge as TriangleGrid, and kCancelled.
SelfIntersections find_self_intersections(const SurfaceView& surface, const Context& context);

// The numbers of the triangles that intersect another one, ascending; otherwise the same.
std::vector<std::uint32_t> find_intersecting_triangles(const SurfaceView& surface,
                                                       const Context& context);

// True if two triangles of different numbers intersect. Thread safe.
bool intersect_each_other(const SurfaceView& surface, std::uint32_t one, std::uint32_t other);

// The number of pairs that intersect, and of which is_counted(first, second) is true; the latter is
// called from several threads. Otherwise the same.
using IsCounted = std::function<bool(std::uint32_t first, std::uint32_t second)>;
std::uint64_t count_intersecting_pairs(const SurfaceView& surface, const Context& context,
                                       const IsCounted& is_counted);

}  // namespace isomesh::mesh
