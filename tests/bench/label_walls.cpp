#include "tests/bench/label_walls.h"

#include <algorithm>
#include <stdexcept>
#include <type_traits>

#include "tests/bench/label_body.h"

namespace isomesh::bench {
namespace {

using Point = std::array<double, 3>;

Point point_of(const mesh::Vec3& v) { return {v[0], v[1], v[2]}; }

// The labels of the samples by their numbers, 0 where it is none of them.
std::vector<std::uint16_t> number_samples(const Samples& samples,
                                          std::span<const std::int64_t> labels) {
  std::vector<std::uint16_t> numbers(samples.dims.samples());
  visit_samples(samples, [&](const auto* values) {
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      const auto value = static_cast<std::int64_t>(values[i]);
      const auto found = std::ranges::lower_bound(labels, value);
      if (found != labels.end() && *found == value) {
        numbers[i] = static_cast<std::uint16_t>(found - labels.begin() + 1);
      }
    }
  });
  return numbers;
}

// Looks at blocks of samples.
class NumberedSamples {
 public:
  NumberedSamples(const Samples& samples, std::span<const std::int64_t> labels)
      : dims_(samples.dims), numbers_(number_samples(samples, labels)) {}

  using Cell = std::array<std::uint32_t, 3>;

  bool is_mixed(const Cell& cell) const {
    const std::uint16_t first = at(cell[0], cell[1], cell[2]);
    return !all_of(cell, cell, [&](std::uint16_t number) { return number == first; });
  }

  bool is_within_labels(const Cell& cell) const {
    Cell low;
    Cell high;
    const Cell last = {dims_.x - 2, dims_.y - 2, dims_.z - 2};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = cell[axis] > 0 ? cell[axis] - 1 : 0;
      high[axis] = std::min(cell[axis] + 1, last[axis]);
    }
    return all_of(low, high, [](std::uint16_t number) { return number != 0; });
  }

  std::vector<Cell> mixed_cells() const {
    std::vector<Cell> cells;
    for (std::uint32_t z = 0; z + 1 < dims_.z; ++z) {
      for (std::uint32_t y = 0; y + 1 < dims_.y; ++y) {
        for (std::uint32_t x = 0; x + 1 < dims_.x; ++x) {
          if (is_mixed({x, y, z})) cells.push_back({x, y, z});
        }
      }
    }
    return cells;
  }

 private:
  std::uint16_t at(std::size_t x, std::size_t y, std::size_t z) const {
    return numbers_[(z * dims_.y + y) * dims_.x + x];
  }

  // True if `is` holds at all corners of the cells from `low` to `high`, both included.
  template <class Is>
  bool all_of(const Cell& low, const Cell& high, Is is) const {
    for (std::size_t z = low[2]; z <= high[2] + std::size_t{1}; ++z) {
      for (std::size_t y = low[1]; y <= high[1] + std::size_t{1}; ++y) {
        for (std::size_t x = low[0]; x <= high[0] + std::size_t{1}; ++x) {
          if (!is(at(x, y, z))) return false;
        }
      }
    }
    return true;
  }

  mesh::Dims dims_;
  std::vector<std::uint16_t> numbers_;
};

// True if the point lies to the left of the line from `a` to `b`, seen from +x. Swapping `a` and
// `b` gives exactly the opposite, so a ray never slips between two triangles.
bool is_left(const Point& a, const Point& b, const Point& point) {
  const bool is_turned = b < a;
  const Point& from = is_turned ? b : a;
  const Point& to = is_turned ? a : b;
  const double side =
      (to[1] - from[1]) * (point[2] - from[2]) - (to[2] - from[2]) * (point[1] - from[1]);
  return (side > 0) != is_turned;
}

// True if the ray from the point in the direction +x crosses the triangle.
bool is_crossed(const std::array<Point, 3>& corners, const Point& point) {
  const auto& [a, b, c] = corners;
  const bool left = is_left(a, b, point);
  if (is_left(b, c, point) != left || is_left(c, a, point) != left) return false;
  const Point u = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
  const Point v = {c[0] - a[0], c[1] - a[1], c[2] - a[2]};
  const double nx = u[1] * v[2] - u[2] * v[1];
  const double ny = u[2] * v[0] - u[0] * v[2];
  const double nz = u[0] * v[1] - u[1] * v[0];
  const double x = a[0] - (ny * (point[1] - a[1]) + nz * (point[2] - a[2])) / nx;
  return x > point[0];
}

// Finds the triangles that a ray along x may cross. Their bounds in y and z overlap the ray's
// column.
class Columns {
 public:
  explicit Columns(const Walls& walls) : walls_(walls) {
    find_bounds();
    counts_.assign(columns_[0] * columns_[1] + 1, 0);
    for (std::size_t t = 0; t < walls.triangles.size(); ++t) {
      for_columns_of(t, [&](std::size_t column) { ++counts_[column + 1]; });
    }
    for (std::size_t c = 1; c < counts_.size(); ++c) counts_[c] += counts_[c - 1];
    triangles_.resize(counts_.back());
    std::vector<std::size_t> next(counts_.begin(), counts_.end() - 1);
    for (std::size_t t = 0; t < walls.triangles.size(); ++t) {
      for_columns_of(t, [&](std::size_t column) { triangles_[next[column]++] = t; });
    }
  }

  std::span<const std::size_t> at(const Point& point) const {
    std::array<std::size_t, 2> column;
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const double place = (point[axis + 1] - low_[axis]) / kWidth;
      if (place < 0 || place >= static_cast<double>(columns_[axis])) return {};
      column[axis] = static_cast<std::size_t>(place);
    }
    const std::size_t c = column[1] * columns_[0] + column[0];
    return std::span(triangles_).subspan(counts_[c], counts_[c + 1] - counts_[c]);
  }

  std::array<Point, 3> corners(std::size_t triangle) const {
    const auto& [a, b, c] = walls_.triangles[triangle];
    return {point_of(walls_.positions[a]), point_of(walls_.positions[b]),
            point_of(walls_.positions[c])};
  }

 private:
  static constexpr double kWidth = 1;  // mm

  void find_bounds() {
    std::array<double, 2> high = {0, 0};
    for (std::size_t axis = 0; axis < 2; ++axis) {
      if (walls_.positions.empty()) continue;
      const auto [least, most] = std::ranges::minmax_element(
          walls_.positions, {}, [&](const mesh::Vec3& v) { return v[axis + 1]; });
      low_[axis] = (*least)[axis + 1];
      high[axis] = (*most)[axis + 1];
    }
    for (std::size_t axis = 0; axis < 2; ++axis) {
      columns_[axis] = static_cast<std::size_t>((high[axis] - low_[axis]) / kWidth) + 1;
    }
  }

  template <class Visit>
  void for_columns_of(std::size_t triangle, Visit visit) const {
    const std::array<Point, 3> points = corners(triangle);
    std::array<std::size_t, 2> first;
    std::array<std::size_t, 2> last;
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const auto [least, most] =
          std::minmax({points[0][axis + 1], points[1][axis + 1], points[2][axis + 1]});
      first[axis] = static_cast<std::size_t>((least - low_[axis]) / kWidth);
      last[axis] = static_cast<std::size_t>((most - low_[axis]) / kWidth);
    }
    for (std::size_t z = first[1]; z <= last[1]; ++z) {
      for (std::size_t y = first[0]; y <= last[0]; ++y) visit(z * columns_[0] + y);
    }
  }

  const Walls& walls_;
  std::array<double, 2> low_ = {0, 0};
  std::array<std::size_t, 2> columns_ = {0, 0};
  std::vector<std::size_t> counts_;  // where each column's triangles begin
  std::vector<std::size_t> triangles_;
};

// In how many labels' surfaces the point is. `crossed` is scratch.
std::size_t labels_around(const Walls& walls, const Columns& columns, const Point& point,
                          std::vector<std::uint16_t>& crossed) {
  crossed.clear();
  for (const std::size_t triangle : columns.at(point)) {
    if (!is_crossed(columns.corners(triangle), point)) continue;
    const mesh::WallSides sides = walls.sides[triangle];
    for (const std::uint16_t number : {sides.front, sides.back}) {
      if (number != 0) crossed.push_back(number);
    }
  }
  std::ranges::sort(crossed);
  std::size_t labels = 0;
  for (auto run = crossed.begin(); run != crossed.end();) {
    const auto end = std::upper_bound(run, crossed.end(), *run);
    labels += static_cast<std::size_t>(end - run) % 2;
    run = end;
  }
  return labels;
}

}  // namespace

std::vector<Probe> probes_near_walls(const Samples& samples, std::span<const std::int64_t> labels,
                                     std::size_t count) {
  const NumberedSamples numbered(samples, labels);
  const auto cells = numbered.mixed_cells();
  if (cells.empty()) throw std::runtime_error("there is no wall between labels");
  std::vector<Probe> probes(count);
  for (std::size_t n = 0; n < count; ++n) {
    const auto& cell = cells[n * cells.size() / count];
    const Point within = even_point(n);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      probes[n].at[axis] = samples.geometry.origin[axis] +
                           samples.geometry.spacing[axis] * (cell[axis] + within[axis]);
    }
    probes[n].is_within_labels = numbered.is_within_labels(cell);
  }
  return probes;
}

Sharing measure_sharing(const Walls& walls, std::span<const Probe> probes) {
  const Columns columns(walls);
  Sharing sharing = {.points = probes.size()};
  std::vector<std::uint16_t> crossed;
  for (const Probe& probe : probes) {
    const std::size_t labels = labels_around(walls, columns, probe.at, crossed);
    sharing.points_within_labels += probe.is_within_labels ? 1 : 0;
    sharing.gaps += probe.is_within_labels && labels == 0 ? 1 : 0;
    sharing.overlaps += labels > 1 ? 1 : 0;
  }
  return sharing;
}

std::vector<double> enclosed_volumes(const Walls& walls, std::size_t labels) {
  std::vector<double> volumes(labels, 0);
  if (walls.positions.empty()) return volumes;
  const Point o = point_of(walls.positions.front());
  const auto from_origin = [&](std::uint32_t vertex) {
    const Point p = point_of(walls.positions[vertex]);
    return Point{p[0] - o[0], p[1] - o[1], p[2] - o[2]};
  };
  for (std::size_t t = 0; t < walls.triangles.size(); ++t) {
    const Point a = from_origin(walls.triangles[t][0]);
    const Point b = from_origin(walls.triangles[t][1]);
    const Point c = from_origin(walls.triangles[t][2]);
    const double six_fold = a[0] * (b[1] * c[2] - b[2] * c[1]) +
                            a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
    const mesh::WallSides sides = walls.sides[t];
    if (sides.back != 0) volumes[sides.back - 1U] += six_fold / 6;
    if (sides.front != 0) volumes[sides.front - 1U] -= six_fold / 6;
  }
  return volumes;
}

}  // namespace isomesh::bench
