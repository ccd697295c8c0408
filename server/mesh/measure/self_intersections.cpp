#include "server/mesh/measure/self_intersections.h"

#include <algorithm>

#include "server/mesh/measure/exact_triangles.h"
#include "server/mesh/measure/triangle_grid.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh {
namespace {

constexpr std::size_t kTrianglesPerBlock = 4096;

struct Box {
  Point low;
  Point high;

  Box(const SurfaceView& surface, const Triangle& triangle)
      : low(to_point(surface.positions[triangle[0]])), high(low) {
    for (const std::uint32_t vertex : triangle) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        low[axis] = std::min(low[axis], double{surface.positions[vertex][axis]});
        high[axis] = std::max(high[axis], double{surface.positions[vertex][axis]});
      }
    }
  }

  bool meets(const Box& other) const {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (other.low[axis] > high[axis] || other.high[axis] < low[axis]) return false;
    }
    return true;
  }

  Point middle_with(const Box& other) const {
    Point middle;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      middle[axis] =
          (std::max(low[axis], other.low[axis]) + std::min(high[axis], other.high[axis])) / 2;
    }
    return middle;
  }
};

// Pairs of a triangle in [begin, end) and one of a higher number.
std::vector<IntersectingPair> pairs_in(const SurfaceView& surface, const TriangleGrid& grid,
                                       std::size_t begin, std::size_t end) {
  std::vector<IntersectingPair> pairs;
  std::vector<std::uint32_t> near;
  for (std::size_t t = begin; t < end; ++t) {
    const Triangle& triangle = surface.triangles[t];
    if (is_flat(surface.positions, triangle)) continue;
    const Box box(surface, triangle);
    near.clear();
    grid.visit_near(box.low, box.high, [&](std::uint32_t other) {
      if (other > t) near.push_back(other);
    });
    std::ranges::sort(near);
    near.erase(std::unique(near.begin(), near.end()), near.end());
    for (const std::uint32_t n : near) {
      const Triangle& other = surface.triangles[n];
      const Box other_box(surface, other);
      if (!box.meets(other_box) || !do_intersect(surface.positions, triangle, other) ||
          is_flat(surface.positions, other)) {
        continue;
      }
      pairs.push_back({static_cast<std::uint32_t>(t), n, box.middle_with(other_box)});
    }
  }
  return pairs;
}

}  // namespace

SelfIntersections find_self_intersections(const SurfaceView& surface, const Context& context) {
  const TriangleGrid grid(surface, context);
  const std::size_t triangles = surface.triangles.size();
  std::vector<std::vector<IntersectingPair>> blocks((triangles + kTrianglesPerBlock - 1) /
                                                    kTrianglesPerBlock);
  parallel_for(context, blocks.size(), [&](std::size_t b) {
    blocks[b] = pairs_in(surface, grid, b * kTrianglesPerBlock,
                         std::min(triangles, (b + 1) * kTrianglesPerBlock));
  });
  SelfIntersections result;
  std::vector<std::uint32_t> named;
  for (const std::vector<IntersectingPair>& pairs : blocks) {
    result.pairs += pairs.size();
    for (const IntersectingPair& pair : pairs) {
      named.insert(named.end(), {pair.first, pair.second});
      if (result.places.size() < SelfIntersections::kMostPlaces) result.places.push_back(pair);
    }
  }
  std::ranges::sort(named);
  result.triangles =
      static_cast<std::uint64_t>(std::unique(named.begin(), named.end()) - named.begin());
  return result;
}

}  // namespace isomesh::mesh
