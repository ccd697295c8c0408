#include "server/mesh/measure/self_intersections.h"

#include <algorithm>
#include <atomic>
#include <bit>
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

// A bit for each triangle. Thread safe.
class TriangleBits {
 public:
  explicit TriangleBits(std::size_t triangles) : words_((triangles + kBits - 1) / kBits) {}

  void set(std::uint32_t triangle) {
    words_[triangle / kBits].fetch_or(bit_of(triangle), std::memory_order_relaxed);
  }
  bool has(std::uint32_t triangle) const {
    return (words_[triangle / kBits].load(std::memory_order_relaxed) & bit_of(triangle)) != 0;
  }
  // The numbers of those that are set, ascending.
  std::vector<std::uint32_t> numbers() const {
    std::size_t count = 0;
    for (const auto& word : words_) count += static_cast<std::size_t>(std::popcount(word.load()));
    std::vector<std::uint32_t> result;
    result.reserve(count);
    for (std::size_t n = 0; n < words_.size(); ++n) {
      for (std::uint64_t rest = words_[n].load(); rest != 0; rest &= rest - 1) {
        result.push_back(static_cast<std::uint32_t>(n * kBits) +
                         static_cast<std::uint32_t>(std::countr_zero(rest)));
      }
    }
    return result;
  }

 private:
  static constexpr std::size_t kBits = 64;
  static std::uint64_t bit_of(std::uint32_t triangle) {
    return std::uint64_t{1} << triangle % kBits;
  }

  std::vector<std::atomic<std::uint64_t>> words_;
};

// Sets the bits of the triangles of a part of the grid that intersect another one.
void mark_in(const TriangleGrid& grid, std::size_t part, TriangleBits& marked) {
  const SurfaceView& surface = grid.surface();
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
    if (!boxes[i].meets(boxes[k]) || (marked.has(first) && marked.has(second)) ||
        !seen.add(first, second) || !intersect_each_other(surface, first, second)) {
      return;
    }
    marked.set(first);
    marked.set(second);
  };
  grid.visit_pairs(part, visit_cell, visit_pair);
}

TriangleBits mark_all(const TriangleGrid& grid, const Context& context) {
  TriangleBits marked(grid.surface().triangles.size());
  parallel_for(context, grid.parts(), [&](std::size_t part) { mark_in(grid, part, marked); });
  return marked;
}

struct FoundPairs {
  std::uint64_t count = 0;
  std::vector<IntersectingPair> first;  // kMostPlaces
};

// The pairs of which the lower number is one of `triangles`, in their order. Each is met in several
// cells, so all of one triangle are gathered before they are counted.
FoundPairs pairs_of(std::span<const std::uint32_t> triangles, const TriangleBits& marked,
                    const TriangleGrid& grid, const IsCounted& is_counted) {
  const SurfaceView& surface = grid.surface();
  FoundPairs found;
  std::vector<std::uint32_t> others;
  for (const std::uint32_t t : triangles) {
    const Box box(surface, surface.triangles[t]);
    others.clear();
    grid.visit_meeting(t, [&](std::uint32_t other) {
      if (other < t || !marked.has(other)) return;
      if (box.meets(Box(surface, surface.triangles[other]))) others.push_back(other);
    });
    std::ranges::sort(others);
    others.erase(std::unique(others.begin(), others.end()), others.end());
    for (const std::uint32_t other : others) {
      if (!intersect_each_other(surface, t, other) || !is_counted(t, other)) continue;
      ++found.count;
      if (found.first.size() == SelfIntersections::kMostPlaces) continue;
      found.first.push_back({t, other, box.middle_with(Box(surface, surface.triangles[other]))});
    }
  }
  return found;
}

SelfIntersections find_pairs(const TriangleGrid& grid, const TriangleBits& marked,
                             const IsCounted& is_counted, const Context& context) {
  constexpr std::size_t kPerTask = 2048;
  const std::vector<std::uint32_t> triangles = marked.numbers();
  std::vector<FoundPairs> parts(chunks_of(triangles.size(), kPerTask));
  const auto find = [&](std::size_t begin, std::size_t end) {
    parts[begin / kPerTask] =
        pairs_of(std::span(triangles).subspan(begin, end - begin), marked, grid, is_counted);
  };
  for_chunks(context, triangles.size(), find, kPerTask);
  SelfIntersections result = {.pairs = 0, .triangles = triangles.size(), .places = {}};
  for (const FoundPairs& part : parts) {
    result.pairs += part.count;
    const std::size_t room = SelfIntersections::kMostPlaces - result.places.size();
    const auto told = std::span(part.first).first(std::min(part.first.size(), room));
    result.places.insert(result.places.end(), told.begin(), told.end());
  }
  return result;
}

constexpr double kMarking = 0.9;  // of the time: usually there are no pairs to count

}  // namespace

SelfIntersections find_self_intersections(const SurfaceView& surface, const Context& context) {
  const TriangleGrid grid(surface, context);
  const TriangleBits marked = mark_all(grid, context.part(0, kMarking));
  const auto all = [](std::uint32_t, std::uint32_t) { return true; };
  return find_pairs(grid, marked, all, context.part(kMarking, 1));
}

std::vector<std::uint32_t> find_intersecting_triangles(const SurfaceView& surface,
                                                       const Context& context) {
  const TriangleGrid grid(surface, context);
  return mark_all(grid, context).numbers();
}

bool intersect_each_other(const SurfaceView& surface, std::uint32_t one, std::uint32_t other) {
  const Triangle& a = surface.triangles[one];
  const Triangle& b = surface.triangles[other];
  return do_intersect(surface.positions, a, b) && !is_flat(surface.positions, a) &&
         !is_flat(surface.positions, b);
}

std::uint64_t count_intersecting_pairs(const SurfaceView& surface, const Context& context,
                                       const IsCounted& is_counted) {
  const TriangleGrid grid(surface, context);
  return find_pairs(grid, mark_all(grid, context), is_counted, context).pairs;
}

}  // namespace isomesh::mesh
