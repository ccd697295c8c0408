#include "server/mesh/measure/self_intersections.h"

#include <algorithm>
#include <span>
#include <utility>

#include "server/mesh/measure/exact_triangles.h"
#include "server/mesh/measure/triangle_grid.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh {
namespace {

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

// Remembers some pairs that were looked at: nearly all pairs meet in several neighbouring cells.
class SeenPairs {
 public:
  bool add(std::uint32_t first, std::uint32_t second) {
    const std::uint64_t pair = std::uint64_t{first} << 32 | second;
    constexpr std::uint64_t kMultiplier = 0x9E3779B97F4A7C15;
    std::uint64_t& seen = seen_[pair * kMultiplier >> (64 - kBits)];
    return std::exchange(seen, pair) != pair;
  }

 private:
  static constexpr unsigned kBits = 14;

  std::vector<std::uint64_t> seen_ = std::vector<std::uint64_t>(std::size_t{1} << kBits);
};

// The pairs that are found in a part of the grid, some several times.
std::vector<IntersectingPair> pairs_in(const TriangleGrid& grid, std::size_t part) {
  const SurfaceView& surface = grid.surface();
  std::vector<IntersectingPair> pairs;
  SeenPairs seen;
  std::span<const TriangleGrid::Entry> cell;
  std::vector<Box> boxes;
  const auto visit_cell = [&](std::span<const TriangleGrid::Entry> entries) {
    cell = entries;
    boxes.clear();
    for (const TriangleGrid::Entry& entry : entries) {
      boxes.emplace_back(surface, surface.triangles[entry.triangle]);
    }
  };
  const auto visit_pair = [&](std::size_t i, std::size_t k) {
    const auto [first, second] = std::minmax(cell[i].triangle, cell[k].triangle);
    if (!boxes[i].meets(boxes[k]) || !seen.add(first, second)) return;
    const Triangle& one = surface.triangles[first];
    const Triangle& other = surface.triangles[second];
    if (!do_intersect(surface.positions, one, other) || is_flat(surface.positions, one) ||
        is_flat(surface.positions, other)) {
      return;
    }
    pairs.push_back({first, second, boxes[i].middle_with(boxes[k])});
  };
  grid.visit_pairs(part, visit_cell, visit_pair);
  return pairs;
}

}  // namespace

SelfIntersections find_self_intersections(const SurfaceView& surface, const Context& context,
                                          std::size_t most_places) {
  const TriangleGrid grid(surface, context);
  std::vector<std::vector<IntersectingPair>> parts(grid.parts());
  parallel_for(context, parts.size(),
               [&](std::size_t part) { parts[part] = pairs_in(grid, part); });
  std::vector<IntersectingPair> pairs;
  for (std::vector<IntersectingPair>& part : parts) {
    pairs.insert(pairs.end(), part.begin(), part.end());
    part = {};
  }
  std::ranges::sort(
      pairs, {}, [](const IntersectingPair& pair) { return std::pair(pair.first, pair.second); });
  // Clang 14 cannot compile std::ranges::unique of g++ 12.
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());

  SelfIntersections result;
  result.pairs = pairs.size();
  const auto told = std::span(pairs).first(std::min(pairs.size(), most_places));
  result.places.assign(told.begin(), told.end());
  std::vector<std::uint32_t> named;
  for (const IntersectingPair& pair : pairs) named.insert(named.end(), {pair.first, pair.second});
  std::ranges::sort(named);
  result.triangles =
      static_cast<std::uint64_t>(std::unique(named.begin(), named.end()) - named.begin());
  return result;
}

}  // namespace isomesh::mesh
