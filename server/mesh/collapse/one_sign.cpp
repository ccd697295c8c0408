#include "server/mesh/collapse/one_sign.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace isomesh::mesh::collapse {
namespace {

// Coordinates in the volume are not negative.
std::int64_t cell_of(double coordinate, std::uint32_t samples) {
  return std::min(static_cast<std::int64_t>(coordinate), std::int64_t{samples} - 2);
}

struct Place {
  const float* corner;  // of the cell
  Vecd in_cell;
  bool is_odd;
};

Place place_of(const Field& field, Vecd p) {
  const std::int64_t x = cell_of(p.x, field.dims.x);
  const std::int64_t y = cell_of(p.y, field.dims.y);
  const std::int64_t z = cell_of(p.z, field.dims.z);
  return {field.values.data() + (x + y * field.step_y() + z * field.step_z()),
          p - Vecd{static_cast<double>(x), static_cast<double>(y), static_cast<double>(z)},
          ((x + y + z) & 1) != 0};
}

// The families of a scheme by what a plane's number is of a place, and the cutting ones with those
// whose planes are looked for along the segments.
struct Cut {
  std::size_t family;
  std::size_t crossing;
};

struct Six {
  static constexpr std::array<Vecd, 6> kNumbers = {
      {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, -1, 0}, {0, 1, -1}, {1, 0, -1}}};
  static constexpr std::array<Cut, 7> kCuts = {
      {{2, 0}, {2, 1}, {2, 3}, {1, 0}, {1, 5}, {4, 0}, {4, 3}}};

  // Kuhn's tetrahedra lie along the ways from a cell's first corner to its last: each is a half of
  // a half of the cell. F on a square's half, and between the squares below and above.
  static double value(const Place& place, const Field& field) {
    const float* const p = place.corner;
    const auto [x, y, z] = place.in_cell;
    const std::ptrdiff_t up_y = field.step_y();
    const std::ptrdiff_t up_z = field.step_z();
    const std::ptrdiff_t x_first = x >= y ? 1 : up_y;
    const double more = std::max(x, y);
    const double less = std::min(x, y);
    // The way has four corners: after `more` and `less` it takes one step each along x and y.
    const std::ptrdiff_t before_second = z >= more ? up_z : x_first;
    const std::ptrdiff_t before_last = z >= less ? x_first + up_z : 1 + up_y;
    const double first = std::max(z, more);
    const double last = std::min(z, less);
    const double second = std::max(std::min(z, more), less);
    const double a = p[0];
    const double b = p[before_second];
    const double c = p[before_last];
    const double d = p[1 + up_y + up_z];
    return a + first * (b - a) + second * (c - b) + last * (d - c);
  }
};

struct Five {
  static constexpr std::array<Vecd, 7> kNumbers = {{{1, 0, 0},
                                                    {0, 1, 0},
                                                    {0, 0, 1},
                                                    {0.5, 0.5, 0.5},
                                                    {-0.5, 0.5, 0.5},
                                                    {0.5, -0.5, 0.5},
                                                    {0.5, 0.5, -0.5}}};
  static constexpr std::array<Cut, 9> kCuts = {
      {{0, 1}, {0, 2}, {0, 3}, {0, 5}, {1, 2}, {1, 3}, {1, 4}, {2, 3}, {2, 4}}};

  // The even corners of a cell have a tetrahedron in the middle; it is left towards the odd corner
  // beyond whose face the place is.
  static double value(const Place& place, const Field& field) {
    Vecd at = place.in_cell;
    const std::ptrdiff_t x_to = place.is_odd ? -1 : 1;
    const float* p = place.corner;
    if (place.is_odd) {
      at.x = 1 - at.x;
      ++p;
    }
    const std::ptrdiff_t y_to = field.step_y();
    const std::ptrdiff_t z_to = field.step_z();
    const double p000 = p[0];
    const double p110 = p[x_to + y_to];
    const double p101 = p[x_to + z_to];
    const double p011 = p[y_to + z_to];
    // F of the tetrahedron in the middle, and what it rises by from there to an odd corner.
    const double x = (p110 + p101 - p000 - p011) / 2;
    const double y = (p110 + p011 - p000 - p101) / 2;
    const double z = (p101 + p011 - p000 - p110) / 2;
    const double middle = p000 + x * at.x + y * at.y + z * at.z;
    const auto rest = [&](std::ptrdiff_t corner, Vecd odd, double beyond) {
      return (double{p[corner]} - (p000 + x * odd.x + y * odd.y + z * odd.z)) *
             std::max(0.0, beyond);
    };
    return middle + rest(x_to, {1, 0, 0}, at.x - at.y - at.z) +
           rest(y_to, {0, 1, 0}, at.y - at.x - at.z) + rest(z_to, {0, 0, 1}, at.z - at.x - at.y) +
           rest(x_to + y_to + z_to, {1, 1, 1}, at.x + at.y + at.z - 2);
  }
};

struct Bcc {
  static constexpr std::array<Vecd, 9> kNumbers = {{{1, 0, 0},
                                                    {0, 1, 0},
                                                    {0, 0, 1},
                                                    {1, -1, 0},
                                                    {0, 1, -1},
                                                    {1, 0, -1},
                                                    {1, 1, 0},
                                                    {0, 1, 1},
                                                    {1, 0, 1}}};
  static constexpr std::array<Cut, 10> kCuts = {
      {{3, 6}, {3, 4}, {3, 7}, {3, 2}, {6, 7}, {6, 4}, {4, 7}, {4, 0}, {5, 8}, {5, 1}}};

  // F between the centre of a cell and the face that the place is nearest to: the centre's share is
  // how near it is, and the rest is F on the face, where the ray from the centre meets it. Beside
  // phantoms cells are Kuhn's.
  static double value(const Place& place, const Field& field) {
    const float* const centre = place.corner + field.first_centre;
    if (*centre == kNoCentre) return Six::value(place, field);
    const std::array<double, 3> from_centre = {place.in_cell.x - 0.5, place.in_cell.y - 0.5,
                                               place.in_cell.z - 0.5};
    const std::array<std::ptrdiff_t, 3> steps = {1, field.step_y(), field.step_z()};
    std::size_t axis = 0;
    for (const std::size_t other : {1U, 2U}) {
      if (std::abs(from_centre[other]) > std::abs(from_centre[axis])) axis = other;
    }
    const bool is_high = from_centre[axis] > 0;
    const double share = 2 * std::abs(from_centre[axis]);
    const float* const p = place.corner + (is_high ? steps[axis] : 0);
    const std::ptrdiff_t up_s = steps[(axis + 1) % 3];
    const std::ptrdiff_t up_t = steps[(axis + 2) % 3];
    // Times the share, as F on the face is.
    const double s = from_centre[(axis + 1) % 3] + share / 2;
    const double t = from_centre[(axis + 2) % 3] + share / 2;
    const float beyond = centre[is_high ? steps[axis] : -steps[axis]];
    const double a = p[0];
    const double b = p[up_s];
    const double c = p[up_t];
    const double d = p[up_s + up_t];
    double on_face = 0;
    if (beyond == kNoCentre) {
      on_face =
          s >= t ? a * (share - s) + b * (s - t) + d * t : a * (share - t) + c * (t - s) + d * s;
    } else {
      // Both diagonals cut it, and its middle has the mean of the centres.
      const double middle = (double{*centre} + double{beyond}) / 2;
      const double low = std::min({s, t, share - s, share - t});
      const double of_b_or_d = s - low;  // along a side of a and b, or of c and d
      const double of_c_or_d = t - low;  // along a side of a and c, or of b and d
      const double rest = share - 2 * low;
      const double on_sides = low == t           ? a * (rest - of_b_or_d) + b * of_b_or_d
                              : low == share - t ? c * (rest - of_b_or_d) + d * of_b_or_d
                              : low == s         ? a * (rest - of_c_or_d) + c * of_c_or_d
                                                 : b * (rest - of_c_or_d) + d * of_c_or_d;
      on_face = 2 * low * middle + on_sides;
    }
    return (1 - share) * double{*centre} + on_face;
  }
};

template <class Scheme>
class Signs {
 public:
  Signs(const Field& field, double sign) : field_(field), sign_(sign) {}

  bool at(Vecd p) const { return sign_ * Scheme::value(place_of(field_, p), field_) > kMargin; }

  bool along(Vecd p, Vecd q) const {
    for (std::size_t family = 0; family < Scheme::kNumbers.size(); ++family) {
      if (!between(p, q, family)) return false;
    }
    return true;
  }

  bool within(Vecd a, Vecd b, Vecd c) const {
    for (std::size_t begin = 0; begin < Scheme::kCuts.size();) {
      const std::size_t family = Scheme::kCuts[begin].family;
      std::size_t end = begin;
      while (end < Scheme::kCuts.size() && Scheme::kCuts[end].family == family) ++end;
      if (!on_cuts(a, b, c, begin, end)) return false;
      begin = end;
    }
    return true;
  }

 private:
  // Planes that two places are strictly on different sides of.
  template <class Visit>
  static bool every_plane(double from, double to, Visit visit) {
    const double low = std::min(from, to);
    const double high = std::max(from, to);
    // Numbers of planes may be negative; std::floor calls a function.
    auto plane = static_cast<double>(static_cast<std::int64_t>(low));
    if (plane <= low) ++plane;
    for (; plane < high; ++plane) {
      if (!visit(plane)) return false;
    }
    return true;
  }

  static Vecd cut(Vecd p, Vecd q, double of_p, double of_q, double plane) {
    return p + (q - p) * ((plane - of_p) / (of_q - of_p));
  }

  bool between(Vecd p, Vecd q, std::size_t family) const {
    const double of_p = dot(Scheme::kNumbers[family], p);
    const double of_q = dot(Scheme::kNumbers[family], q);
    return every_plane(of_p, of_q, [&](double plane) { return at(cut(p, q, of_p, of_q, plane)); });
  }

  // On the segments of the family of the cuts [begin, end).
  bool on_cuts(Vecd a, Vecd b, Vecd c, std::size_t begin, std::size_t end) const {
    const Vecd& number = Scheme::kNumbers[Scheme::kCuts[begin].family];
    double low = dot(number, a);
    double middle = dot(number, b);
    double high = dot(number, c);
    const auto order = [](double& m, double& n, Vecd& p, Vecd& q) {
      if (!(m > n)) return;
      std::swap(m, n);
      std::swap(p, q);
    };
    order(low, middle, a, b);
    order(middle, high, b, c);
    order(low, middle, a, b);
    return every_plane(low, high, [&](double plane) {
      const Vecd p = cut(a, c, low, high, plane);
      const Vecd q = plane == middle  ? b
                     : plane < middle ? cut(a, b, low, middle, plane)
                                      : cut(b, c, middle, high, plane);
      for (std::size_t k = begin; k < end; ++k) {
        if (!between(p, q, Scheme::kCuts[k].crossing)) return false;
      }
      return true;
    });
  }

  const Field& field_;
  const double sign_;
};

template <class Test>
bool with_scheme(const Field& field, double sign, Test test) {
  switch (field.scheme) {
    case Scheme::kSix:
      return test(Signs<Six>(field, sign));
    case Scheme::kFive:
      return test(Signs<Five>(field, sign));
    case Scheme::kBcc:
      return test(Signs<Bcc>(field, sign));
  }
  return false;
}

}  // namespace

bool OneSign::at(Vecd p) const {
  const auto is_within = [](double x, std::uint32_t samples) {
    return x >= 0 && x <= samples - 1.0;
  };
  return is_within(p.x, field_.dims.x) && is_within(p.y, field_.dims.y) &&
         is_within(p.z, field_.dims.z) &&
         with_scheme(field_, sign_, [&](const auto& signs) { return signs.at(p); });
}

bool OneSign::along(Vecd p, Vecd q) const {
  return with_scheme(field_, sign_, [&](const auto& signs) { return signs.along(p, q); });
}

bool OneSign::within(Vecd a, Vecd b, Vecd c) const {
  return with_scheme(field_, sign_, [&](const auto& signs) { return signs.within(a, b, c); });
}

}  // namespace isomesh::mesh::collapse
