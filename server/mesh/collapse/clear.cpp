#include "server/mesh/collapse/clear.h"

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>

namespace isomesh::mesh::collapse {
namespace {

// Within 2^31; std::floor calls a function where the processor has no instruction for it.
double floor_of(double x) {
  const auto whole = static_cast<double>(static_cast<std::int32_t>(x));
  return whole > x ? whole - 1 : whole;
}

SampleSteps steps_of(const Field& field) {
  return {1, field.step_y(), field.step_z(), static_cast<std::ptrdiff_t>(field.first_centre)};
}

// F at a place that is counted from the sample at `base`.
template <class Planes>
double value_from(const float* base, const SampleSteps& steps, Vecd place) {
  const Vecd cell = {floor_of(place.x), floor_of(place.y), floor_of(place.z)};
  const auto x = static_cast<std::ptrdiff_t>(cell.x);
  const auto y = static_cast<std::ptrdiff_t>(cell.y);
  const auto z = static_cast<std::ptrdiff_t>(cell.z);
  return Planes::value(base + (x + y * steps.y + z * steps.z), steps, ((x + y + z) & 1) != 0,
                       place - cell);
}

}  // namespace

// In Kuhn's tetrahedra the way from a cell's first corner to its last goes along the axes in the
// order of the place's coordinates.
double SixPlanes::value(const float* corner, const SampleSteps& steps, bool /*is_odd*/,
                        Vecd in_cell) {
  const auto [a, b, c] = in_cell;
  const double high = std::max(a, std::max(b, c));
  const double low = std::min(a, std::min(b, c));
  const double middle = a + b + c - high - low;
  // The order of the coordinates selects the first and the last step. Branches would be
  // unpredictable.
  const std::ptrdiff_t x_or_z = a >= c ? steps.x : steps.z;
  const std::ptrdiff_t y_or_z = b >= c ? steps.y : steps.z;
  const std::ptrdiff_t not_x = a >= c ? steps.z : steps.x;
  const std::ptrdiff_t not_y = b >= c ? steps.z : steps.y;
  const std::ptrdiff_t first = a >= b ? x_or_z : y_or_z;
  const std::ptrdiff_t last = a >= b ? not_y : not_x;
  const std::ptrdiff_t all = steps.x + steps.y + steps.z;
  return double{corner[0]} * (1 - high) + double{corner[first]} * (high - middle) +
         double{corner[all - last]} * (middle - low) + double{corner[all]} * low;
}

// A cell whose corner 0 is even: four of its corners are even, and each of the others cuts off the
// tetrahedron of itself and its three neighbours, which are even. An odd cell is its mirror image.
double FivePlanes::value(const float* corner, const SampleSteps& steps, bool is_odd, Vecd in_cell) {
  const double a = is_odd ? 1 - in_cell.x : in_cell.x;
  const auto [_, b, c] = in_cell;
  const auto at = [&](int x, int y, int z) {
    return double{corner[(is_odd ? 1 - x : x) * steps.x + y * steps.y + z * steps.z]};
  };
  const double x = a - b - c;
  const double y = b - a - c;
  const double z = c - a - b;
  const double all = a + b + c - 2;
  if (x > 0) return at(1, 0, 0) * x + at(0, 0, 0) * (1 - a) + at(1, 1, 0) * b + at(1, 0, 1) * c;
  if (y > 0) return at(0, 1, 0) * y + at(0, 0, 0) * (1 - b) + at(1, 1, 0) * a + at(0, 1, 1) * c;
  if (z > 0) return at(0, 0, 1) * z + at(0, 0, 0) * (1 - c) + at(1, 0, 1) * a + at(0, 1, 1) * b;
  if (all > 0) {
    return at(1, 1, 1) * all + at(1, 1, 0) * (1 - c) + at(1, 0, 1) * (1 - b) +
           at(0, 1, 1) * (1 - a);
  }
  return -0.5 * (at(0, 0, 0) * all + at(1, 1, 0) * z + at(1, 0, 1) * y + at(0, 1, 1) * x);
}

// A place in a cell is in the pyramid from its centre to one of its faces. Around the face are four
// tetrahedra between this centre and the one beyond. At the border there is none beyond: a value
// for it that makes the mean of both that of the diagonal's ends leaves two tetrahedra.
double BccPlanes::value(const float* corner, const SampleSteps& steps, bool is_odd, Vecd in_cell) {
  const float* const centre = corner + steps.centre;
  if (*centre == kNoCentre) return SixPlanes::value(corner, steps, is_odd, in_cell);
  double normal = in_cell.x - 0.5;  // from the centre
  double u = in_cell.y - 0.5;
  double v = in_cell.z - 0.5;
  std::ptrdiff_t to_face = steps.x;
  std::ptrdiff_t to_u = steps.y;
  std::ptrdiff_t to_v = steps.z;
  const auto turn_to = [&](double& other, std::ptrdiff_t& to_other) {
    if (std::abs(other) <= std::abs(normal)) return;
    std::swap(other, normal);
    std::swap(to_other, to_face);
  };
  turn_to(u, to_u);
  turn_to(v, to_v);
  const float* const face = normal > 0 ? corner + to_face : corner;
  const auto at = [](const float* point) { return double{*point}; };
  const float other = normal > 0 ? centre[to_face] : centre[-to_face];
  const double beyond =
      other == kNoCentre ? at(face) + at(face + to_u + to_v) - at(centre) : double{other};
  // The tetrahedron's side of the square, and how far the place is along it from its middle.
  const bool is_along_v = std::abs(u) >= std::abs(v);
  const double to_side = is_along_v ? u : v;
  const double along = is_along_v ? v : u;
  const std::ptrdiff_t step = is_along_v ? to_v : to_u;
  const float* const side = to_side > 0 ? face + (is_along_v ? to_u : to_v) : face;
  const double out = std::abs(to_side);
  const double to_centre = 0.5 - std::abs(normal);
  return at(centre) * (0.5 - out + to_centre) + beyond * (0.5 - out - to_centre) +
         at(side) * (out - along) + at(side + step) * (out + along);
}

template <class Planes>
Clear<Planes>::Clear(const Field& field) : field_(field), steps_(steps_of(field)) {
  for (std::size_t d = 0; d < lines_.size(); ++d) {
    const LineDirection& line = Planes::kLines[d];
    lines_[d] = {steps_.to(line.per_first), steps_.to(line.per_second), steps_.to(line.per_along)};
  }
}

template <class Planes>
Vecf Clear<Planes>::base(Vecf a) {
  const Vecd base = Planes::base_of({floor_of(a.x), floor_of(a.y), floor_of(a.z)});
  base_ = narrow(base);
  at_base_ = field_.values.data() + static_cast<std::ptrdiff_t>(base.x) +
             static_cast<std::ptrdiff_t>(base.y) * steps_.y +
             static_cast<std::ptrdiff_t>(base.z) * steps_.z;
  return base_;
}

template <class Planes>
double Clear<Planes>::value(Vecd place) const {
  return value_from<Planes>(at_base_, steps_, place);
}

template <class Planes>
bool Clear<Planes>::is_positive(double value) {
  if (value > kMargin) return true;
  failed_ = value;
  return false;
}

template <class Planes>
bool Clear<Planes>::point(const PlaneNumbers& a, double sign) {
  return is_positive(sign * value(a));
}

template <class Planes>
bool Clear<Planes>::edge(const PlaneNumbers& a, const PlaneNumbers& b, double sign) {
  for (std::size_t k = 0; k < Planes::kFamilies; ++k) {
    const auto [low, high] = std::minmax(a.of[k], b.of[k]);
    for (double plane = floor_of(low) + 1; plane < high; ++plane) {
      if (!crossing(a, b, k, plane, sign)) return false;
    }
  }
  return true;
}

template <class Planes>
bool Clear<Planes>::crossing(const PlaneNumbers& a, const PlaneNumbers& b, std::size_t family,
                             double plane, double sign) {
  const Vecd from = {a.of[0], a.of[1], a.of[2]};
  const Vecd to = {b.of[0], b.of[1], b.of[2]};
  const double begin = a.of[family];
  return is_positive(sign * value(from + (to - from) * ((plane - begin) / (b.of[family] - begin))));
}

template <class Planes>
bool Clear<Planes>::inside(const PlaneNumbers& a, const PlaneNumbers& b, const PlaneNumbers& c,
                           double sign) {
  std::array<double, Planes::kFamilies> low;
  std::array<double, Planes::kFamilies> high;
  for (std::size_t k = 0; k < low.size(); ++k) {
    low[k] = -floor_of(-std::min(a.of[k], std::min(b.of[k], c.of[k])));
    high[k] = floor_of(std::max(a.of[k], std::max(b.of[k], c.of[k])));
  }
  for (std::size_t d = 0; d < Planes::kLines.size(); ++d) {
    const auto& [u, v, along, _, __, ___] = Planes::kLines[d];
    for (double i = low[u]; i <= high[u]; ++i) {
      for (double j = low[v]; j <= high[v]; ++j) {
        if (!line(a, b, c, d, i, j, sign)) return false;
      }
    }
  }
  return true;
}

// The areas that a line makes with the triangle's edges, seen along it, say whether it crosses the
// triangle.
template <class Planes>
bool Clear<Planes>::line(const PlaneNumbers& a, const PlaneNumbers& b, const PlaneNumbers& c,
                         std::size_t direction, double i, double j, double sign) {
  const LineDirection& families = Planes::kLines[direction];
  const std::size_t u = families.first;
  const std::size_t v = families.second;
  const std::size_t w = families.along;
  const double au = a.of[u] - i;
  const double av = a.of[v] - j;
  const double bu = b.of[u] - i;
  const double bv = b.of[v] - j;
  const double cu = c.of[u] - i;
  const double cv = c.of[v] - j;
  const double of_a = bu * cv - bv * cu;
  const double of_b = cu * av - cv * au;
  const double of_c = au * bv - av * bu;
  const double area = of_a + of_b + of_c;
  if (area == 0) return true;  // along the lines, which leave the triangle through its edges
  const double turn = area > 0 ? 1 : -1;
  if (std::min(turn * of_a, std::min(turn * of_b, turn * of_c)) < 0) return true;
  const double along = (of_a * a.of[w] + of_b * b.of[w] + of_c * c.of[w]) / area;
  if constexpr (std::is_same_v<Planes, BccPlanes>) {
    const auto half_steps = [](const std::array<std::int8_t, 3>& steps) {
      return Vecd{steps[0] * 0.5, steps[1] * 0.5, steps[2] * 0.5};
    };
    Vecd place = half_steps(families.per_first) * i + half_steps(families.per_second) * j +
                 half_steps(families.per_along) * along;
    // Rounding leads out of the volume nowhere.
    const auto keep_within = [&](double& coordinate, std::size_t k) {
      const auto [least, most] = std::minmax({a.of[k], b.of[k], c.of[k]});
      coordinate = std::clamp<double>(coordinate, least, most);
    };
    keep_within(place.x, 0);
    keep_within(place.y, 1);
    keep_within(place.z, 2);
    return is_positive(sign * value(place));
  }
  const double whole = floor_of(along);
  const auto& [first, second, step] = lines_[direction];
  const float* const p =
      at_base_ + (static_cast<std::ptrdiff_t>(i) * first + static_cast<std::ptrdiff_t>(j) * second +
                  static_cast<std::ptrdiff_t>(whole) * step);
  const double from = p[0];
  const double to = p[step];
  return is_positive(sign * (from + (along - whole) * (to - from)));
}

template class Clear<SixPlanes>;
template class Clear<FivePlanes>;
template class Clear<BccPlanes>;

double value_at(const Field& field, Vecf place) {
  const SampleSteps steps = steps_of(field);
  const float* const base = field.values.data();
  switch (field.scheme) {
    case Scheme::kSix:
      return value_from<SixPlanes>(base, steps, wide(place));
    case Scheme::kFive:
      return value_from<FivePlanes>(base, steps, wide(place));
    case Scheme::kBcc:
      return value_from<BccPlanes>(base, steps, wide(place));
  }
  return 0;
}

}  // namespace isomesh::mesh::collapse
