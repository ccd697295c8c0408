#include <algorithm>
#include <cmath>

#include "server/mesh/measure/point_triangle.h"
#include "server/mesh/measure/triangle_grid.h"

namespace isomesh::mesh {
namespace {

// The first search radius, as a share of a cell's side: most points lie this near.
constexpr double kFirstReach = 0.2;

// From this radius on, in sides of a cell, words are compared with it, and not only cells: far from
// a surface many words are in the cube around the ball, and few in the ball.
constexpr double kFarReach = 8;

constexpr std::uint32_t kSide = 4;  // of a word, in cells

// The bits of a word whose cells lie in [low, high] along an axis: kAxisBits[axis][low][high].
using AxisBits = std::array<std::array<std::uint64_t, kSide>, kSide>;
constexpr std::array<AxisBits, 3> kAxisBits = [] {
  std::array<AxisBits, 3> table = {};
  for (std::uint32_t low = 0; low < kSide; ++low) {
    for (std::uint32_t high = low; high < kSide; ++high) {
      for (std::uint32_t bit = 0; bit < kSide * kSide * kSide; ++bit) {
        const std::array<std::uint32_t, 3> at = {bit % 4, bit / 4 % 4, bit / 16};
        for (std::size_t axis = 0; axis < 3; ++axis) {
          if (at[axis] < low || at[axis] > high) continue;
          table[axis][low][high] |= std::uint64_t{1} << bit;
        }
      }
    }
  }
  return table;
}();

// How far outside the bounds a point is, along the axis where it is farthest.
double outside_by(const Point& point, const Point& low, const Point& high) {
  double most = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    most = std::max({most, low[axis] - point[axis], point[axis] - high[axis]});
  }
  return most;
}

}  // namespace

std::uint64_t TriangleGrid::bits_within(const CellRange& range, const Cell& word,
                                        std::size_t level) {
  const std::size_t shift = 2 * level;
  std::uint64_t bits = ~std::uint64_t{0};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::int64_t first = std::int64_t{word[axis]} * kWordSide;
    const std::int64_t low = std::int64_t{range.low[axis] >> shift} - first;
    const std::int64_t high = std::int64_t{range.high[axis] >> shift} - first;
    // The range may have shrunk since, and no longer contain the word.
    if (low >= kWordSide || high < 0) return 0;
    bits &= kAxisBits[axis][static_cast<std::size_t>(std::max<std::int64_t>(low, 0))]
                     [static_cast<std::size_t>(std::min<std::int64_t>(high, kWordSide - 1))];
  }
  return bits;
}

unsigned TriangleGrid::bit_nearest_to_middle(const CellRange& range, const Cell& word,
                                             std::size_t level) {
  unsigned bit = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::int64_t middle = (std::int64_t{range.low[axis]} + range.high[axis]) / 2 >> 2 * level;
    const std::int64_t at = middle - std::int64_t{word[axis]} * kWordSide;
    bit |= static_cast<unsigned>(std::clamp<std::int64_t>(at, 0, kWordSide - 1)) << 2 * axis;
  }
  return bit;
}

std::uint64_t TriangleGrid::bits_xored(std::uint64_t word, unsigned number) {
  constexpr std::array<std::uint64_t, 6> kLower = {0x5555555555555555, 0x3333333333333333,
                                                   0x0f0f0f0f0f0f0f0f, 0x00ff00ff00ff00ff,
                                                   0x0000ffff0000ffff, 0x00000000ffffffff};
  for (unsigned digit = 0; digit < kLower.size(); ++digit) {
    if ((number >> digit & 1) == 0) continue;
    const unsigned shift = 1U << digit;
    word = (word & kLower[digit]) << shift | (word >> shift & kLower[digit]);
  }
  return word;
}

double TriangleGrid::squared_distance_to(std::size_t level, const Cell& cell,
                                         const Point& point) const {
  const double side = side_mm_ * static_cast<double>(std::uint64_t{1} << 2 * level);
  double squared = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double from = point[axis] - low_[axis] - cell[axis] * side;
    const double outside = std::max(std::max(-from, from - side), 0.0);
    squared += outside * outside;
  }
  return squared;
}

bool TriangleGrid::is_on(std::size_t level, const Cell& cell, const Point& from,
                         const Point& to) const {
  constexpr double kSlack = 1e-9;  // more than rounding can add; of a cell's side
  const double side = side_mm_ * static_cast<double>(std::uint64_t{1} << 2 * level);
  Point low;
  Point high;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    low[axis] = low_[axis] + cell[axis] * side - kSlack * side_mm_;
    high[axis] = low_[axis] + (cell[axis] + 1.0) * side + kSlack * side_mm_;
  }
  return line_meets(low, high, from, to);
}

TriangleGrid::Content TriangleGrid::content_at(const Cell& word, std::size_t index,
                                               unsigned bit) const {
  const std::uint64_t lower = (std::uint64_t{1} << bit) - 1;
  const std::size_t cell =
      before_[index] + static_cast<std::size_t>(std::popcount(levels_[0].bits[index] & lower));
  return slabs_[word[2] / slab_layers_].content(cell);
}

void TriangleGrid::look_at(std::uint32_t triangle, Search& search) const {
  std::uint32_t& seen = search.seen[triangle % search.seen.size()];
  if (seen == triangle) return;
  seen = triangle;
  ++search.nearest.steps;
  const double squared = squared_distance(search.point, corners_of(surface_, triangle));
  if (squared >= search.nearest.squared_mm) return;
  search.nearest.triangle = triangle;
  search.nearest.squared_mm = squared;
}

void TriangleGrid::look_within(double radius_mm, Search& search) const {
  // More than rounding can add.
  constexpr double kMargin = 1 + 1e-9;
  constexpr double kStepMargin = 1e-9;
  const Point& point = search.point;
  StepRange box;
  CellRange range;
  double squared_reach = 0;
  double known = radius_mm * radius_mm;
  const auto reach_within = [&](double radius) {
    const double reach = radius * kMargin + kStepMargin * side_mm_;
    squared_reach = reach * reach;
    box = {steps_of({point[0] - reach, point[1] - reach, point[2] - reach}),
           steps_of({point[0] + reach, point[1] + reach, point[2] + reach})};
    range = {cell_of(box.low), cell_of(box.high)};
  };
  reach_within(radius_mm);
  const bool is_far = radius_mm > kFarReach * side_mm_;
  const auto reaches = [&](std::size_t level, const Cell& word) {
    return !is_far || squared_distance_to(level, word, point) <= squared_reach;
  };
  const auto visit = [&](const Cell& cell, const Content& content) {
    ++search.nearest.steps;
    if (squared_distance_to(0, cell, point) > squared_reach) return;
    // True if the reach has shrunk.
    const auto look = [&](const Entry& entry) {
      look_at(entry.triangle, search);
      if (search.nearest.squared_mm >= known) return false;
      known = search.nearest.squared_mm;
      if (known <= search.enough_squared_mm) known = 0;
      reach_within(std::sqrt(known));
      return true;
    };
    if (content.tree == nullptr) {
      std::uint32_t reached = reach_in(box, cell);
      for (const Entry& entry : content.entries) {
        if (!BoxInCell::may_meet(reached, entry.box) || !look(entry)) continue;
        reached = reach_in(box, cell);
      }
    } else if (!search.is_in_order) {
      search.nearest.steps += content.tree->visit_near(content.entries, point, squared_reach, look);
    } else {
      // After one was found, a nearer one of the same or the next cell takes its place.
      const bool is_found = search.nearest.squared_mm <= search.enough_squared_mm;
      const double most = is_found ? search.nearest.squared_mm * kMargin : squared_reach;
      std::vector<Entry> near;
      search.nearest.steps += content.tree->visit_near(
          content.entries, point, most, [&](const Entry& entry) { near.push_back(entry); });
      std::ranges::sort(near, {}, &Entry::triangle);
      for (const Entry& entry : near) {
        const StepRange its = box_of(corners_of(surface_, entry.triangle));
        if (BoxInCell::may_meet(reach_in(box, cell), box_in(its, cell))) look(entry);
      }
    }
  };
  descend(levels_.size() - 1, {0, 0, 0}, range, reaches, visit);
}

TriangleGrid::Nearest TriangleGrid::nearest(const Point& point, std::uint32_t guess) const {
  if (levels_.empty()) return {};
  Search search = {point, 0, false, {}, {}};
  search.seen.fill(kNone);
  if (guess != kNone) look_at(guess, search);
  // A distant guess would cause a search of too many cells.
  double radius = outside_by(point, low_, high_) + kFirstReach * side_mm_;
  for (; search.nearest.squared_mm > radius * radius; radius *= 2) {
    look_within(radius, search);
    if (search.nearest.squared_mm <= radius * radius) return search.nearest;
  }
  look_within(std::sqrt(search.nearest.squared_mm), search);
  return search.nearest;
}

TriangleGrid::Nearest TriangleGrid::within(const Point& point, double squared_mm,
                                           std::uint32_t guess) const {
  if (levels_.empty()) return {};
  if (guess != kNone) {
    const double squared = squared_distance(point, corners_of(surface_, guess));
    if (squared <= squared_mm) return {guess, squared, 1};
  }
  Search search = {point, squared_mm, true, {}, {}};
  search.seen.fill(kNone);
  look_within(std::sqrt(squared_mm), search);
  if (search.nearest.squared_mm <= squared_mm) return search.nearest;
  return {.steps = search.nearest.steps};
}

}  // namespace isomesh::mesh
