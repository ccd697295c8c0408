#include "server/mesh/bound/clear.h"

#include <algorithm>
#include <cmath>

namespace isomesh::mesh::bound {
namespace {

constexpr std::size_t kFamilies = 6;
constexpr std::size_t kDirections = 7;
// By direction: the two families whose numbers tell its lines apart, and the one that counts along
// them.
constexpr std::array<std::uint8_t, kDirections> kFirst = {1, 0, 0, 3, 5, 4, 3};
constexpr std::array<std::uint8_t, kDirections> kSecond = {2, 2, 1, 2, 1, 0, 4};
constexpr std::array<std::uint8_t, kDirections> kAlong = {0, 1, 2, 1, 2, 2, 2};

// Within 2^31; std::floor calls a function where the processor has no instruction for it.
inline float floor_of(float x) {
  const auto whole = static_cast<float>(static_cast<std::int32_t>(x));
  return whole > x ? whole - 1 : whole;
}
inline double floor_of(double x) {
  const auto whole = static_cast<double>(static_cast<std::int32_t>(x));
  return whole > x ? whole - 1 : whole;
}

}  // namespace

Clear::Clear(const Field& field) : field_(field) {
  const std::ptrdiff_t x = 1;
  const std::ptrdiff_t y = field.step_y();
  const std::ptrdiff_t z = field.step_z();
  step_ = {x, y, z, x + y, x + z, y + z, x + y + z};
  first_ = {y, x, x, x, x, y, x};
  second_ = {z, z, y, z, y, x, x + y};
  last_ = x + y + z;
  for (unsigned order = 0; order < 8; ++order) {
    const bool xy = (order & 1) != 0;
    const bool yz = (order & 2) != 0;
    const bool xz = (order & 4) != 0;
    next_[order] = xy && xz ? x : (!xy && yz ? y : z);
    before_last_[order] = last_ - (yz && xz ? z : (xy && !yz ? y : x));
  }
}

void Clear::base(Vecf a) {
  base_ = {floor_of(a.x), floor_of(a.y), floor_of(a.z)};
  at_base_ = field_.values.data() + static_cast<std::ptrdiff_t>(base_.x) +
             static_cast<std::ptrdiff_t>(base_.y) * field_.step_y() +
             static_cast<std::ptrdiff_t>(base_.z) * field_.step_z();
}

bool Clear::contains(Vecf a) const {
  const auto within = [](float x, std::uint32_t samples) {
    return x >= 0 && x <= static_cast<float>(samples - 1);
  };
  return within(a.x, field_.dims.x) && within(a.y, field_.dims.y) && within(a.z, field_.dims.z);
}

PlaneNumbers Clear::at(Vecf a) const {
  const Vecf d = a - base_;
  return {{d.x, d.y, d.z, d.x - d.y, d.y - d.z, d.x - d.z, 0.5F, 0.5F}};
}

double Clear::value(double x, double y, double z) const {
  const double i = floor_of(x);
  const double j = floor_of(y);
  const double k = floor_of(z);
  const double a = x - i;
  const double b = y - j;
  const double c = z - k;
  const float* const p = at_base_ + (static_cast<std::ptrdiff_t>(i) +
                                     static_cast<std::ptrdiff_t>(j) * field_.step_y() +
                                     static_cast<std::ptrdiff_t>(k) * field_.step_z());
  const double high = std::max(a, std::max(b, c));
  const double low = std::min(a, std::min(b, c));
  const double middle = a + b + c - high - low;
  const unsigned order = static_cast<unsigned>(a >= b) | static_cast<unsigned>(b >= c) << 1 |
                         static_cast<unsigned>(a >= c) << 2;
  return double{p[0]} * (1 - high) + double{p[next_[order]]} * (high - middle) +
         double{p[before_last_[order]]} * (middle - low) + double{p[last_]} * low;
}

bool Clear::is_positive(double value) {
  if (value > kMargin) return true;
  failed_ = value;
  return false;
}

bool Clear::point(const PlaneNumbers& a, double sign) { return is_positive(sign * value(a)); }

bool Clear::edge(const PlaneNumbers& a, const PlaneNumbers& b, double sign) {
  alignas(32) std::array<float, 8> next;
  alignas(32) std::array<float, 8> end;
  for (std::size_t k = 0; k < 8; ++k) {
    next[k] = floor_of(std::min(a.of[k], b.of[k])) + 1;
    end[k] = std::max(a.of[k], b.of[k]);
  }
  const Vecd from = {a.of[0], a.of[1], a.of[2]};
  const Vecd way = Vecd{b.of[0], b.of[1], b.of[2]} - from;
  for (std::size_t k = 0; k < kFamilies; ++k) {
    if (!(next[k] < end[k])) continue;
    const double begin = a.of[k];
    const double per = 1 / (b.of[k] - begin);
    for (double plane = next[k]; plane < end[k]; ++plane) {
      const double t = (plane - begin) * per;
      if (!is_positive(sign * value(from.x + t * way.x, from.y + t * way.y, from.z + t * way.z))) {
        return false;
      }
    }
  }
  return true;
}

bool Clear::inside(const PlaneNumbers& a, const PlaneNumbers& b, const PlaneNumbers& c,
                   double sign) {
  alignas(32) std::array<float, 8> low;
  alignas(32) std::array<float, 8> high;
  for (std::size_t k = 0; k < 8; ++k) {
    low[k] = -floor_of(-std::min(a.of[k], std::min(b.of[k], c.of[k])));
    high[k] = floor_of(std::max(a.of[k], std::max(b.of[k], c.of[k])));
  }
  std::array<bool, 8> meets;
  for (std::size_t k = 0; k < 8; ++k) meets[k] = low[k] <= high[k];
  for (std::size_t d = 0; d < kDirections; ++d) {
    if (!meets[kFirst[d]] || !meets[kSecond[d]]) continue;
    if (!lines(a, b, c, d, low, high, sign)) return false;
  }
  return true;
}

// Those of one direction. The areas that a line makes with the triangle's edges, seen along it, say
// whether it meets the triangle; they change by whole steps from line to line and are exact.
bool Clear::lines(const PlaneNumbers& a, const PlaneNumbers& b, const PlaneNumbers& c,
                  std::size_t direction, const std::array<float, 8>& low,
                  const std::array<float, 8>& high, double sign) {
  const std::size_t u = kFirst[direction];
  const std::size_t v = kSecond[direction];
  const std::size_t w = kAlong[direction];
  const double i0 = low[u];
  const double j0 = low[v];
  const double au = a.of[u] - i0;
  const double av = a.of[v] - j0;
  const double bu = b.of[u] - i0;
  const double bv = b.of[v] - j0;
  const double cu = c.of[u] - i0;
  const double cv = c.of[v] - j0;
  double row_a = bu * cv - bv * cu;
  double row_b = cu * av - cv * au;
  double row_c = au * bv - av * bu;
  const double area = row_a + row_b + row_c;
  if (area == 0) return true;  // along the lines, which leave the triangle through its edges
  const double turn = area > 0 ? 1 : -1;
  for (double i = i0; i <= high[u]; ++i) {
    double ea = row_a;
    double eb = row_b;
    double ec = row_c;
    for (double j = j0; j <= high[v]; ++j) {
      if (std::min(turn * ea, std::min(turn * eb, turn * ec)) >= 0) {
        const double along = (ea * a.of[w] + eb * b.of[w] + ec * c.of[w]) / area;
        const double whole = floor_of(along);
        const float* const p = at_base_ + (static_cast<std::ptrdiff_t>(i) * first_[direction] +
                                           static_cast<std::ptrdiff_t>(j) * second_[direction] +
                                           static_cast<std::ptrdiff_t>(whole) * step_[direction]);
        const double from = p[0];
        const double to = p[step_[direction]];
        if (!is_positive(sign * (from + (along - whole) * (to - from)))) return false;
      }
      ea += cu - bu;
      eb += au - cu;
      ec += bu - au;
    }
    row_a += bv - cv;
    row_b += cv - av;
    row_c += av - bv;
  }
  return true;
}

}  // namespace isomesh::mesh::bound
