#include "server/mesh/measure/triangle_grid.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>

#include "server/mesh/measure/point_triangle.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh {
namespace {

constexpr std::size_t kTrianglesPerTask = 1 << 15;
constexpr std::uint32_t kWordSide = 4;  // cells of a word along each axis
constexpr std::uint32_t kWordCells = 64;
constexpr std::uint32_t kMostSlabs = 32;

// The side of a cell relative to the root mean square of the edges. In larger cells there are more
// triangles to look at; of smaller ones more cells.
constexpr double kCellSide = 1.0;

// The first search radius, as a share of a cell's side: most points lie this near.
constexpr double kFirstReach = 0.2;

// Empty cells cost only bits, but there may be many.
constexpr std::uint64_t kMostCellsPerTriangle = 256;
constexpr std::uint64_t kMostCells = std::uint64_t{1} << 32;
constexpr std::uint32_t kMostCellsPerAxis = 1 << 16;

// The sums over a run of triangles that the cell size follows from.
struct Bounds {
  Point low = {INFINITY, INFINITY, INFINITY};
  Point high = {-INFINITY, -INFINITY, -INFINITY};
  double squared_edges = 0;
  bool is_finite = true;

  void add(const Corners& corners) {
    for (std::size_t i = 0; i < 3; ++i) {
      const Point edge = minus(corners[(i + 1) % 3], corners[i]);
      squared_edges += dot(edge, edge);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        is_finite = is_finite && std::isfinite(corners[i][axis]);
        low[axis] = std::min(low[axis], corners[i][axis]);
        high[axis] = std::max(high[axis], corners[i][axis]);
      }
    }
  }

  void add(const Bounds& other) {
    squared_edges += other.squared_edges;
    is_finite = is_finite && other.is_finite;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], other.low[axis]);
      high[axis] = std::max(high[axis], other.high[axis]);
    }
  }
};

Corners corners_of(const SurfaceView& surface, std::size_t triangle) {
  const auto& [a, b, c] = surface.triangles[triangle];
  return {to_point(surface.positions[a]), to_point(surface.positions[b]),
          to_point(surface.positions[c])};
}

Bounds bounds_of(const SurfaceView& surface, const Context& context) {
  const std::size_t triangles = surface.triangles.size();
  std::vector<Bounds> parts(chunks_of(triangles, kTrianglesPerTask));
  const auto add = [&](std::size_t t) { parts[t / kTrianglesPerTask].add(corners_of(surface, t)); };
  for_each(context, triangles, add, kTrianglesPerTask);
  Bounds whole;
  for (const Bounds& part : parts) whole.add(part);
  return whole;
}

// The bits of a word whose cells lie in [low, high] along an axis: kAxisBits[axis][low][high].
using AxisBits = std::array<std::array<std::uint64_t, kWordSide>, kWordSide>;
constexpr std::array<AxisBits, 3> kAxisBits = [] {
  std::array<AxisBits, 3> table = {};
  for (std::uint32_t low = 0; low < kWordSide; ++low) {
    for (std::uint32_t high = low; high < kWordSide; ++high) {
      for (std::uint32_t bit = 0; bit < kWordCells; ++bit) {
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

TriangleGrid::TriangleGrid(const SurfaceView& surface, const Context& context) : surface_(surface) {
  const std::size_t triangles = surface.triangles.size();
  if (triangles >= kNone) {
    throw Error(ErrorCode::kTooLarge, "the surface has " + std::to_string(triangles) +
                                          " triangles; more than 32 bits can number");
  }
  context.throw_if_stopped();
  if (triangles == 0) return;
  const Context quiet = {context.stop, nullptr};
  choose_cells(quiet);
  fill_slabs(quiet);
  make_upper_levels();
}

void TriangleGrid::choose_cells(const Context& context) {
  const Bounds bounds = bounds_of(surface_, context);
  if (!bounds.is_finite) {
    throw Error(ErrorCode::kUnusableVolume, "a position of the surface is not a finite number");
  }
  low_ = bounds.low;
  high_ = bounds.high;
  const auto triangles = static_cast<double>(surface_.triangles.size());
  side_mm_ = kCellSide * std::sqrt(bounds.squared_edges / (3 * triangles));
  const Point extent = minus(high_, low_);
  const double longest = std::max({extent[0], extent[1], extent[2]});
  // All triangles may be one point.
  if (!(side_mm_ > 0)) side_mm_ = longest > 0 ? longest : 1;
  side_mm_ = std::max(side_mm_, longest / (kMostCellsPerAxis - 2));
  const double most =
      std::min(static_cast<double>(kMostCells), kMostCellsPerTriangle * (triangles + kWordCells));
  const auto count = [&](std::size_t axis) { return std::floor(extent[axis] / side_mm_) + 1; };
  while (count(0) * count(1) * count(2) > most) side_mm_ *= 1.25;
  Level& level = levels_.emplace_back();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    cells_[axis] = static_cast<std::uint32_t>(count(axis));
    last_step_[axis] = kCellSteps * cells_[axis] - 1;
    level.words[axis] = (cells_[axis] + kWordSide - 1) / kWordSide;
  }
  steps_per_mm_ = kCellSteps / side_mm_;
  level.bits.resize(std::size_t{level.words[0]} * level.words[1] * level.words[2]);
  before_.resize(level.bits.size());
}

TriangleGrid::Steps TriangleGrid::steps_of(const Point& point) const {
  Steps steps;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double at = (point[axis] - low_[axis]) * steps_per_mm_;
    steps[axis] = static_cast<std::uint32_t>(
        std::min(std::max(at, 0.0), static_cast<double>(last_step_[axis])));
  }
  return steps;
}

std::uint32_t TriangleGrid::box_in(const StepRange& box, const Cell& cell) {
  std::uint32_t packed = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    packed |= step_in(box.low[axis], cell[axis]) << kFieldBits * axis;
    packed |= (kCellSteps - 1 - step_in(box.high[axis], cell[axis])) << kFieldBits * (axis + 3);
  }
  return packed;
}

TriangleGrid::StepRange TriangleGrid::box_of(const Corners& corners) const {
  Point low;
  Point high;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::tie(low[axis], high[axis]) =
        std::minmax({corners[0][axis], corners[1][axis], corners[2][axis]});
  }
  return {steps_of(low), steps_of(high)};
}

// Calls put(cell, box) for the cells of these layers that the triangle may reach.
template <class Put>
void TriangleGrid::rasterise(std::uint32_t triangle, std::uint32_t first_layer,
                             std::uint32_t last_layer, Put put) const {
  constexpr std::uint64_t kFewCells = 12;
  constexpr double kMargin = 1 + 1e-6;  // more than rounding takes
  const Corners corners = corners_of(surface_, triangle);
  const StepRange box = box_of(corners);
  Cell low = cell_of(box.low);
  Cell high = cell_of(box.high);
  const std::uint64_t all =
      std::uint64_t{high[0] - low[0] + 1} * (high[1] - low[1] + 1) * (high[2] - low[2] + 1);
  low[2] = std::max(low[2], first_layer);
  high[2] = std::min(high[2], last_layer);
  const TriangleReach reach(corners);
  const double half = side_mm_ / 2 * kMargin;
  Cell cell;
  for (cell[2] = low[2]; cell[2] <= high[2]; ++cell[2]) {
    for (cell[1] = low[1]; cell[1] <= high[1]; ++cell[1]) {
      for (cell[0] = low[0]; cell[0] <= high[0]; ++cell[0]) {
        const Point centre = {low_[0] + (cell[0] + 0.5) * side_mm_,
                              low_[1] + (cell[1] + 0.5) * side_mm_,
                              low_[2] + (cell[2] + 0.5) * side_mm_};
        if (all > 1 &&
            !(all <= kFewCells ? reach.plane_meets(centre, half) : reach.meets(centre, half))) {
          continue;
        }
        put(cell, box_in(box, cell));
      }
    }
  }
}

void TriangleGrid::fill_slabs(const Context& context) {
  const std::size_t triangles = surface_.triangles.size();
  // The layers of words that each triangle reaches; a slab looks at all triangles.
  std::vector<std::array<std::uint16_t, 2>> layers(triangles);
  const auto find_layers = [&](std::size_t t) {
    const StepRange box = box_of(corners_of(surface_, t));
    layers[t] = {static_cast<std::uint16_t>(cell_of(box.low)[2] / kWordSide),
                 static_cast<std::uint16_t>(cell_of(box.high)[2] / kWordSide)};
  };
  for_each(context, triangles, find_layers, kTrianglesPerTask);
  const std::uint32_t all = levels_[0].words[2];
  const std::uint64_t layer_words = std::uint64_t{levels_[0].words[0]} * levels_[0].words[1];
  const std::uint32_t wanted = triangles < kTrianglesPerTask ? 1 : std::min(all, kMostSlabs);
  slab_layers_ = (all + wanted - 1) / wanted;
  // An entry names a bit of its slab in 32 bits.
  const std::uint64_t most = std::max<std::uint64_t>(1, kNone / kWordCells / layer_words);
  slab_layers_ = static_cast<std::uint32_t>(std::min<std::uint64_t>(slab_layers_, most));
  slabs_.resize((all + slab_layers_ - 1) / slab_layers_);
  parallel_for(context, slabs_.size(), [&](std::size_t s) {
    const auto slab = static_cast<std::uint32_t>(s);
    fill_slab(slab, entries_of(slab, layers));
  });
}

std::vector<TriangleGrid::Placed> TriangleGrid::entries_of(
    std::uint32_t slab, std::span<const std::array<std::uint16_t, 2>> layers_of_triangles) const {
  const std::uint32_t first = slab * slab_layers_;
  const std::uint32_t last = std::min(first + slab_layers_, levels_[0].words[2]) - 1;
  const std::size_t first_word = levels_[0].index({0, 0, first});
  std::vector<Placed> entries;
  for (std::uint32_t t = 0; t < layers_of_triangles.size(); ++t) {
    const auto& [low, high] = layers_of_triangles[t];
    if (low > last || high < first) continue;
    rasterise(t, first * kWordSide, last * kWordSide + kWordSide - 1,
              [&](const Cell& cell, std::uint32_t box) {
                const std::size_t word = levels_[0].index({cell[0] / 4, cell[1] / 4, cell[2] / 4});
                const std::size_t bit = cell[0] % 4 + 4 * (cell[1] % 4) + 16 * (cell[2] % 4);
                entries.push_back(
                    {static_cast<std::uint32_t>((word - first_word) * kWordCells + bit), {t, box}});
              });
  }
  return entries;
}

void TriangleGrid::fill_slab(std::uint32_t slab, std::span<const Placed> entries) {
  Level& level = levels_[0];
  const std::size_t begin = level.index({0, 0, slab * slab_layers_});
  const std::size_t end = level.index({0, 0, std::min((slab + 1) * slab_layers_, level.words[2])});
  for (const Placed& entry : entries) {
    level.bits[begin + entry.bit / kWordCells] |= std::uint64_t{1} << entry.bit % kWordCells;
  }
  std::uint32_t cells = 0;
  for (std::size_t word = begin; word < end; ++word) {
    before_[word] = cells;
    cells += static_cast<std::uint32_t>(std::popcount(level.bits[word]));
  }
  const auto cell_of_entry = [&](const Placed& entry) {
    const std::size_t word = begin + entry.bit / kWordCells;
    const std::uint64_t lower = (std::uint64_t{1} << entry.bit % kWordCells) - 1;
    return before_[word] + static_cast<std::uint32_t>(std::popcount(level.bits[word] & lower));
  };
  // Shifted by one: while the lists are filled, a begin is where its list continues.
  Slab& filled = slabs_[slab];
  filled.begins.assign(cells + 2, 0);
  for (const Placed& entry : entries) ++filled.begins[cell_of_entry(entry) + 2];
  for (std::size_t cell = 2; cell < filled.begins.size(); ++cell) {
    filled.begins[cell] += filled.begins[cell - 1];
  }
  filled.entries.resize(entries.size());
  for (const Placed& entry : entries) {
    filled.entries[filled.begins[cell_of_entry(entry) + 1]++] = entry.entry;
  }
  filled.begins.pop_back();
}

void TriangleGrid::make_upper_levels() {
  while (levels_.back().bits.size() > 1) {
    const Level& below = levels_.back();
    Level level;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      level.words[axis] = (below.words[axis] + kWordSide - 1) / kWordSide;
    }
    level.bits.resize(std::size_t{level.words[0]} * level.words[1] * level.words[2]);
    std::size_t index = 0;
    Cell word;
    for (word[2] = 0; word[2] < below.words[2]; ++word[2]) {
      for (word[1] = 0; word[1] < below.words[1]; ++word[1]) {
        for (word[0] = 0; word[0] < below.words[0]; ++word[0]) {
          if (below.bits[index++] == 0) continue;
          level.bits[level.index({word[0] / 4, word[1] / 4, word[2] / 4})] |=
              std::uint64_t{1} << (word[0] % 4 + 4 * (word[1] % 4) + 16 * (word[2] % 4));
        }
      }
    }
    levels_.push_back(std::move(level));
  }
}

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

double TriangleGrid::squared_distance_to(const Cell& cell, const Point& point) const {
  double squared = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double from = point[axis] - low_[axis] - cell[axis] * side_mm_;
    const double outside = std::max(std::max(-from, from - side_mm_), 0.0);
    squared += outside * outside;
  }
  return squared;
}

std::span<const TriangleGrid::Entry> TriangleGrid::entries_at(const Cell& word, std::size_t index,
                                                              unsigned bit) const {
  const Slab& slab = slabs_[word[2] / slab_layers_];
  const std::uint64_t lower = (std::uint64_t{1} << bit) - 1;
  const std::size_t cell =
      before_[index] + static_cast<std::size_t>(std::popcount(levels_[0].bits[index] & lower));
  return std::span(slab.entries)
      .subspan(slab.begins[cell], slab.begins[cell + 1] - slab.begins[cell]);
}

void TriangleGrid::look_at(std::uint32_t triangle, Search& search) const {
  std::uint32_t& seen = search.seen[triangle % search.seen.size()];
  if (seen == triangle) return;
  seen = triangle;
  const double squared = squared_distance(search.point, corners_of(surface_, triangle));
  if (squared < search.nearest.squared_mm) search.nearest = {triangle, squared};
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
  auto visit = [&](const Cell& cell, std::span<const Entry> entries) {
    if (squared_distance_to(cell, point) > squared_reach) return;
    std::uint32_t reached = reach_in(box, cell);
    for (const Entry& entry : entries) {
      if (!may_meet(reached, entry.box)) continue;
      look_at(entry.triangle, search);
      if (search.nearest.squared_mm >= known) continue;
      known = search.nearest.squared_mm;
      if (known <= search.enough_squared_mm) known = 0;
      reach_within(std::sqrt(known));
      reached = reach_in(box, cell);
    }
  };
  descend(levels_.size() - 1, {0, 0, 0}, range, visit);
}

TriangleGrid::Nearest TriangleGrid::nearest(const Point& point, std::uint32_t guess) const {
  if (levels_.empty()) return {};
  Search search = {point, 0, {}, {}};
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
    if (squared <= squared_mm) return {guess, squared};
  }
  Search search = {point, squared_mm, {}, {}};
  search.seen.fill(kNone);
  look_within(std::sqrt(squared_mm), search);
  return search.nearest.squared_mm <= squared_mm ? search.nearest : Nearest{};
}

}  // namespace isomesh::mesh
