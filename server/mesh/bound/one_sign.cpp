#include "server/mesh/bound/one_sign.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace isomesh::mesh::bound {
namespace {

constexpr std::size_t kFamiliesOfPlanes = 6;
constexpr double kSame = 1e-12;  // a point is on a plane

double number_in(std::size_t family, Vecd p) {
  switch (family) {
    case 0:
      return p.x;
    case 1:
      return p.y;
    case 2:
      return p.z;
    case 3:
      return p.x - p.y;
    case 4:
      return p.y - p.z;
    default:
      return p.x - p.z;
  }
}

// Convex, in order. Each of the six families cuts off two sides at most.
class Polygon {
 public:
  void add(Vecd p) {
    x_[size_] = p.x;
    y_[size_] = p.y;
    z_[size_++] = p.z;
  }
  std::size_t size() const { return size_; }
  Vecd operator[](std::size_t i) const { return {x_[i], y_[i], z_[i]}; }

 private:
  static constexpr std::size_t kMost = 24;
  std::size_t size_ = 0;
  std::array<double, kMost> x_, y_, z_;  // set up to size_: most of the time would go into zeros
};

// F by its own words: in Kuhn's tetrahedra the way from a cell's first corner to its last goes
// along the axes in the order of the point's coordinates in the cell.
double value_at(const Field& field, Vecd p) {
  const std::array<double, 3> place = {p.x, p.y, p.z};
  const std::array<std::uint32_t, 3> samples = {field.dims.x, field.dims.y, field.dims.z};
  const std::array<std::ptrdiff_t, 3> steps = {1, field.step_y(), field.step_z()};
  std::array<std::pair<double, std::ptrdiff_t>, 3> order;
  std::ptrdiff_t at = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double cell = std::clamp(std::floor(place[axis]), 0.0, samples[axis] - 2.0);
    at += static_cast<std::ptrdiff_t>(cell) * steps[axis];
    order[axis] = {place[axis] - cell, steps[axis]};
  }
  if (order[0].first < order[1].first) std::swap(order[0], order[1]);
  if (order[1].first < order[2].first) std::swap(order[1], order[2]);
  if (order[0].first < order[1].first) std::swap(order[0], order[1]);
  double before = 1;
  double value = 0;
  for (const auto& [coordinate, step] : order) {
    value += double{field.values[static_cast<std::size_t>(at)]} * (before - coordinate);
    before = coordinate;
    at += step;
  }
  return value + double{field.values[static_cast<std::size_t>(at)]} * before;
}

class Cutter {
 public:
  Cutter(const Field& field, double sign) : field_(field), sign_(sign) {}

  bool is_positive(Vecd p) const { return sign_ * value_at(field_, p) > kMargin; }

  // Whether all corners of the pieces that the families from this one on make are positive; those
  // of the polygon are.
  bool are_pieces_positive(const Polygon& polygon, std::size_t family) const {
    if (family == kFamiliesOfPlanes) return true;
    double low = number_in(family, polygon[0]);
    double high = low;
    for (std::size_t i = 1; i < polygon.size(); ++i) {
      low = std::min(low, number_in(family, polygon[i]));
      high = std::max(high, number_in(family, polygon[i]));
    }
    // The last plane first: what is below it is cut further by those before.
    const double plane = std::ceil(high - kSame) - 1;
    if (!(plane > low + kSame)) return are_pieces_positive(polygon, family + 1);
    Polygon below;
    Polygon above;
    return cut(polygon, family, plane, below, above) && are_pieces_positive(below, family) &&
           are_pieces_positive(above, family + 1);
  }

 private:
  bool cut(const Polygon& polygon, std::size_t family, double plane, Polygon& below,
           Polygon& above) const {
    for (std::size_t i = 0; i < polygon.size(); ++i) {
      const Vecd p = polygon[i];
      const Vecd q = polygon[i + 1 < polygon.size() ? i + 1 : 0];
      const double from = number_in(family, p) - plane;
      const double to = number_in(family, q) - plane;
      if (from <= kSame) below.add(p);
      if (from >= -kSame) above.add(p);
      if (!(from < -kSame && to > kSame) && !(from > kSame && to < -kSame)) continue;
      const Vecd between = p + (q - p) * (from / (from - to));
      if (!is_positive(between)) return false;
      below.add(between);
      above.add(between);
    }
    return true;
  }

  const Field& field_;
  const double sign_;
};

}  // namespace

bool has_one_sign(const Field& field, Vecd a, Vecd b, Vecd c, double sign) {
  const Cutter cutter(field, sign);
  Polygon triangle;
  for (const Vecd p : {a, b, c}) {
    const auto is_within = [](double x, std::uint32_t samples) {
      return x >= 0 && x <= samples - 1.0;
    };
    if (!is_within(p.x, field.dims.x) || !is_within(p.y, field.dims.y) ||
        !is_within(p.z, field.dims.z) || !cutter.is_positive(p)) {
      return false;
    }
    triangle.add(p);
  }
  return cutter.are_pieces_positive(triangle, 0);
}

}  // namespace isomesh::mesh::bound
