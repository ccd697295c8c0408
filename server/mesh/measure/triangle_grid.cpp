#include "server/mesh/measure/triangle_grid.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>
#include <utility>

#include "server/mesh/measure/point_triangle.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh {
namespace {

constexpr std::size_t kTrianglesPerTask = 1 << 15;

constexpr std::uint32_t kMostSlabs = 32;

// The side of a cell relative to the root mean square of the edges. In larger cells there are more
// triangles to look at; of smaller ones more cells.
constexpr double kCellSide = 1.0;

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

Bounds bounds_of(const SurfaceView& surface, const Context& context) {
  const std::size_t triangles = surface.triangles.size();
  std::vector<Bounds> parts(chunks_of(triangles, kTrianglesPerTask));
  const auto add = [&](std::size_t t) { parts[t / kTrianglesPerTask].add(corners_of(surface, t)); };
  for_each(context, triangles, add, kTrianglesPerTask);
  Bounds whole;
  for (const Bounds& part : parts) whole.add(part);
  return whole;
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
  make_trees(quiet);
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

TriangleGrid::StepRange TriangleGrid::box_of(const Corners& corners) const {
  Point low;
  Point high;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::tie(low[axis], high[axis]) =
        std::minmax({corners[0][axis], corners[1][axis], corners[2][axis]});
  }
  return {steps_of(low), steps_of(high)};
}

// Calls put(cell, box) for the cells of these layers that the triangle may reach. Returns how many
// cells and rows it tested: in a large box only those near the triangle's plane.
template <class Put>
std::uint64_t TriangleGrid::rasterise(std::uint32_t triangle, std::uint32_t first_layer,
                                      std::uint32_t last_layer, Put put) const {
  constexpr std::uint64_t kFewCells = 12;
  constexpr std::uint64_t kManyCells = 512;
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
  std::uint64_t tested = 0;
  Cell cell;
  for (cell[2] = low[2]; cell[2] <= high[2]; ++cell[2]) {
    for (cell[1] = low[1]; cell[1] <= high[1]; ++cell[1]) {
      std::uint32_t end = high[0] + 1;
      cell[0] = low[0];
      if (all > kManyCells) {
        const auto [first, last] = reach.ways_along_x(centre_of(cell), half);
        const auto in_row = [&](double way_mm) {
          return std::clamp<double>(low[0] + way_mm / side_mm_, low[0], end);
        };
        cell[0] = static_cast<std::uint32_t>(in_row(first - side_mm_));
        end = static_cast<std::uint32_t>(in_row(last + 2 * side_mm_));
        ++tested;
      }
      for (; cell[0] < end; ++cell[0]) {
        ++tested;
        const Point centre = centre_of(cell);
        if (all > 1 &&
            !(all <= kFewCells ? reach.plane_meets(centre, half) : reach.meets(centre, half))) {
          continue;
        }
        put(cell, box_in(box, cell));
      }
    }
  }
  return tested;
}

void TriangleGrid::visit_meeting(std::uint32_t triangle,
                                 const std::function<void(std::uint32_t other)>& visit) const {
  const Corners corners = corners_of(surface_, triangle);
  const auto visit_other = [&](const Entry& entry) {
    if (entry.triangle != triangle) visit(entry.triangle);
  };
  rasterise(triangle, 0, cells_[2] - 1, [&](const Cell& cell, std::uint32_t box) {
    const Cell word = {cell[0] / kWordSide, cell[1] / kWordSide, cell[2] / kWordSide};
    const unsigned bit = cell[0] % 4 + 4 * (cell[1] % 4) + 16 * (cell[2] % 4);
    const auto [entries, tree] = content_at(word, levels_[0].index(word), bit);
    if (tree != nullptr) return tree->visit_meeting(entries, corners, visit_other);
    const std::uint32_t reached = BoxInCell::reach_of(box);
    for (const Entry& entry : entries) {
      if (BoxInCell::may_meet(reached, entry.box)) visit_other(entry);
    }
  });
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

void TriangleGrid::make_trees(const Context& context) {
  struct Crowd {
    Slab* slab;
    std::size_t number;
    Point centre;
  };
  std::vector<Crowd> crowds;
  const Level& level = levels_[0];
  std::size_t index = 0;
  Cell word;
  for (word[2] = 0; word[2] < level.words[2]; ++word[2]) {
    Slab& slab = slabs_[word[2] / slab_layers_];
    for (word[1] = 0; word[1] < level.words[1]; ++word[1]) {
      for (word[0] = 0; word[0] < level.words[0]; ++word[0], ++index) {
        std::size_t cell = before_[index];
        for (std::uint64_t rest = level.bits[index]; rest != 0; rest &= rest - 1, ++cell) {
          if (slab.begins[cell + 1] - slab.begins[cell] <= kCrowd) continue;
          const auto bit = static_cast<std::uint32_t>(std::countr_zero(rest));
          const Cell at = {4 * word[0] + bit % 4, 4 * word[1] + bit / 4 % 4,
                           4 * word[2] + bit / 16};
          crowds.push_back({&slab, slab.crowded.size(), centre_of(at)});
          slab.crowded.push_back(cell);
        }
      }
    }
  }
  for (Slab& slab : slabs_) slab.trees.resize(slab.crowded.size());
  parallel_for(context, crowds.size(), [&](std::size_t n) {
    const auto& [slab, number, centre] = crowds[n];
    const std::size_t cell = slab->crowded[number];
    const auto entries =
        std::span(slab->entries)
            .subspan(slab->begins[cell], slab->begins[cell + 1] - slab->begins[cell]);
    slab->trees[number] = TriangleTree(surface_, centre, side_mm_, entries);
  });
}

Point TriangleGrid::centre_of(const Cell& cell) const {
  return {low_[0] + (cell[0] + 0.5) * side_mm_, low_[1] + (cell[1] + 0.5) * side_mm_,
          low_[2] + (cell[2] + 0.5) * side_mm_};
}

TriangleGrid::Size TriangleGrid::size() const {
  Size size;
  for (const Slab& slab : slabs_) {
    size.tested_cells += slab.tested_cells;
    size.entries += slab.entries.size();
    for (const TriangleTree& tree : slab.trees) size.nodes += tree.nodes();
  }
  return size;
}

std::vector<TriangleGrid::Placed> TriangleGrid::entries_of(
    std::uint32_t slab, std::span<const std::array<std::uint16_t, 2>> layers_of_triangles) {
  const std::uint32_t first = slab * slab_layers_;
  const std::uint32_t last = std::min(first + slab_layers_, levels_[0].words[2]) - 1;
  const std::size_t first_word = levels_[0].index({0, 0, first});
  std::vector<Placed> entries;
  for (std::uint32_t t = 0; t < layers_of_triangles.size(); ++t) {
    const auto& [low, high] = layers_of_triangles[t];
    if (low > last || high < first) continue;
    const auto put = [&](const Cell& cell, std::uint32_t box) {
      const std::size_t word = levels_[0].index({cell[0] / 4, cell[1] / 4, cell[2] / 4});
      const std::size_t bit = cell[0] % 4 + 4 * (cell[1] % 4) + 16 * (cell[2] % 4);
      entries.push_back(
          {static_cast<std::uint32_t>((word - first_word) * kWordCells + bit), {t, box}});
    };
    slabs_[slab].tested_cells +=
        rasterise(t, first * kWordSide, last * kWordSide + kWordSide - 1, put);
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

}  // namespace isomesh::mesh
