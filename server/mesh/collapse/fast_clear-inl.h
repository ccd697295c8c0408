// Clear for the six-way split and the body-centred lattice in eight lanes. Compiled once for each
// instruction set, see collapse_block.cpp.
//
// The lanes are families of planes, or directions of lines. On the body-centred lattice those of
// the six-way split in the coordinates u, v and w (planes.h) stand for x, y and z. Each sign is
// told in single precision where it is far enough from zero for that, and by Clear where it is not:
// the answers are the same.
#if defined(ISOMESH_FAST_CLEAR_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_FAST_CLEAR_INL_H_
#undef ISOMESH_FAST_CLEAR_INL_H_
#else
#define ISOMESH_FAST_CLEAR_INL_H_
#endif

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include <hwy/highway.h>

#include "server/mesh/collapse/clear.h"
#include "server/mesh/collapse/tube.h"
#include "server/mesh/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::collapse::HWY_NAMESPACE {

using namespace isomesh::mesh::HWY_NAMESPACE;

// The places of a vertex in T+, from lane 0, and in T-, from lane 4.
HWY_INLINE Lanes copies_of(const Vertex& vertex) {
  const auto& [_, in, out] = vertex;
  return Lanes{in.x, in.y, in.z, 0, out.x, out.y, out.z, 0};
}

// Clear for any planes, as FastClear is for some.
template <class Planes>
class SlowClear : public Clear<Planes> {
 public:
  using Point = typename Planes::Numbers;
  using Clear<Planes>::Clear;

  void base(Vecf a, float /*most*/) { Clear<Planes>::base(a); }
  Point at(const Lanes& copies, Side side) const {
    const std::size_t x = side == Side::kIn ? 0 : 4;
    return Clear<Planes>::at({copies[x], copies[x + 1], copies[x + 2]});
  }
};

template <class Planes>
class FastClear {
 public:
  explicit FastClear(const Field& field)
      : field_(field),
        clear_(field),
        is_huge_(field.step_z() > kLargestLayer ||
                 (kIsBcc && field.first_centre > kLastFirstCentre)) {
    const auto step_y = static_cast<std::int32_t>(field.step_y());
    const auto step_z = static_cast<std::int32_t>(field.step_z());
    Step x = {1, 0};
    Step y = {step_y, 0};
    Step z = {step_z, 0};
    if constexpr (kIsBcc) {
      x = {-1 + step_y + step_z, 1};
      y = {1 - step_y + step_z, 1};
      z = {1 + step_y - step_z, 1};
      // Twice the steps from a sample to a centre, but for those half steps.
      to_centre_ = static_cast<std::int32_t>(2 * std::int64_t{field.first_centre} -
                                             (1 + std::int64_t{step_y} + step_z));
    }
    // A plane's samples: `number_` steps for its number, then along its two axes.
    number_ = steps_of({x, y, z, x, y, x});
    first_axis_ = steps_of({y, x, x, x + y, y + z, x + z});
    second_axis_ = steps_of({z, z, y, z, x, y});
    line_first_ = steps_of({y, x, x, x, x, y, x});
    line_second_ = steps_of({z, z, y, z, y, x, x + y});
    line_step_ = steps_of({x, y, z, x + y, x + z, y + z, x + y + z});
  }

  using Point = Lanes;

  // Places of which at() is taken from now on are within `most` voxels of `a` along each axis.
  void base(Vecf a, float most) {
    const Vecf base = clear_.base(a);
    base_ = copies_of({{}, base, base});
    is_exact_ = is_huge_ || !is_far_from_border(a, most);
    least_ = kErrorPerVoxel * (1 + (kIsBcc ? 4 : 2) * most);
  }
  HWY_INLINE Lanes at(const Lanes& copies, Side side) const {
    Lanes d = copies - base_;
    if constexpr (kIsBcc) {
      d = __builtin_shufflevector(d, d, 1, 0, 0, 3, 5, 4, 4, 7) +
          __builtin_shufflevector(d, d, 2, 2, 1, 3, 6, 6, 5, 7);
    }
    constexpr Lanes kNoFamily = {0, 0, 0, 0, 0, 0, 0.5F, 0.5F};
    if (side == Side::kIn) {
      return __builtin_shufflevector(d, d, 0, 1, 2, 0, 1, 0, 3, 3) -
             __builtin_shufflevector(d, d, 3, 3, 3, 1, 2, 2, 3, 3) + kNoFamily;
    }
    return __builtin_shufflevector(d, d, 4, 5, 6, 4, 5, 4, 7, 7) -
           __builtin_shufflevector(d, d, 7, 7, 7, 5, 6, 6, 7, 7) + kNoFamily;
  }

  bool point(const Lanes& a, double sign) { return clear_.point(numbers(a), sign); }
  double value(const Lanes& a) const { return clear_.value(numbers(a)); }
  double failed() const { return clear_.failed(); }

  // Lanes are families.
  HWY_INLINE bool edge(const Lanes& a, const Lanes& b, double sign) {
    if (kIsBcc && is_exact_) return clear_.edge(numbers(a), numbers(b), sign);
    const Lanes low = smaller(a, b);
    const Lanes high = larger(a, b);
    Lanes plane = as_lanes(floor_of(low)) + 1;
    Mask crosses = plane < high;
    if (!any(crosses)) return true;
    if (is_exact_) return clear_.edge(numbers(a), numbers(b), sign);
    const Lanes way = b - a;
    const Lanes per = 1 / way;
    const auto first = [](const Lanes& x) {
      return __builtin_shufflevector(x, x, 1, 0, 0, 1, 2, 2, 6, 7);
    };
    const auto second = [](const Lanes& x) {
      return __builtin_shufflevector(x, x, 2, 2, 1, 2, 0, 1, 6, 7);
    };
    do {
      const Lanes share = crosses ? (plane - a) * per : splat(0);
      // Rounding leads out of the volume nowhere.
      const Lanes at_first = larger(first(low), first(a) + share * first(way));
      const Lanes at_second = larger(second(low), second(a) + share * second(way));
      const Lanes value =
          in_plane(__builtin_convertvector(plane, Mask), at_first, at_second, crosses);
      const Mask doubt = crosses & ~(splat(static_cast<float>(sign)) * value > least_);
      for (unsigned left = bits(doubt); left != 0; left &= left - 1) {
        const auto k = static_cast<std::size_t>(std::countr_zero(left));
        if (!clear_.crossing(numbers(a), numbers(b), kFirstFamily + k, double{plane[k]}, sign))
          return false;
      }
      plane += 1;
      crosses = plane < high;
    } while (any(crosses));
    return true;
  }

  // Lanes are directions.
  HWY_INLINE bool inside(const Lanes& a, const Lanes& b, const Lanes& c, double sign) {
    if (kIsBcc && is_exact_) return clear_.inside(numbers(a), numbers(b), numbers(c), sign);
    const Lanes least = smaller(a, smaller(b, c));
    const Lanes most = larger(a, larger(b, c));
    const Lanes low = -as_lanes(floor_of(-least));
    const Lanes high = as_lanes(floor_of(most));
    const auto first = [](const Lanes& x) {
      return __builtin_shufflevector(x, x, 1, 0, 0, 3, 5, 4, 3, 6);
    };
    const auto second = [](const Lanes& x) {
      return __builtin_shufflevector(x, x, 2, 2, 1, 2, 1, 0, 4, 6);
    };
    const auto along = [](const Lanes& x) {
      return __builtin_shufflevector(x, x, 0, 1, 2, 1, 2, 2, 2, 6);
    };
    const Lanes last_i = first(high);
    const Lanes last_j = second(high);
    Lanes i = first(low);
    const Lanes first_j = second(low);
    if (!any((i <= last_i) & (first_j <= last_j))) return true;
    if (is_exact_) return clear_.inside(numbers(a), numbers(b), numbers(c), sign);
    const Lanes wide = most - least + 1;
    // Bounds on rounding errors: `flat` of an area, and `steep` / area of F.
    const Lanes flat = kAreaError * first(wide) * second(wide);
    const Lanes steep = kSteepest * 4 * flat * along(wide);
    const Lanes aw = along(a);
    const Lanes bw = along(b);
    const Lanes cw = along(c);
    for (Mask rows = i <= last_i; any(rows); i += 1, rows = i <= last_i) {
      const Lanes au = first(a) - i;
      const Lanes bu = first(b) - i;
      const Lanes cu = first(c) - i;
      Lanes j = first_j;
      for (Mask live = rows & (j <= last_j); any(live); j += 1, live = rows & (j <= last_j)) {
        const Lanes av = second(a) - j;
        const Lanes bv = second(b) - j;
        const Lanes cv = second(c) - j;
        const Lanes of_a = bu * cv - bv * cu;
        const Lanes of_b = cu * av - cv * au;
        const Lanes of_c = au * bv - av * bu;
        const Mask meets = live & ((smaller(of_a, smaller(of_b, of_c)) >= -flat) |
                                   (larger(of_a, larger(of_b, of_c)) <= flat));
        if (!any(meets)) continue;
        const Lanes area = of_a + of_b + of_c;
        const Mask sure = meets & ((area > 16 * flat) | (area < -16 * flat));
        const Lanes per = sure ? 1 / area : splat(0);
        const Lanes k =
            smaller(along(most), larger(along(least), (of_a * aw + of_b * bw + of_c * cw) * per));
        const Lanes value = on_line(i, j, k, sure);
        const Lanes error = least_ + steep * (per < 0 ? -per : per);
        const Mask doubt = meets & ~(sure & (splat(static_cast<float>(sign)) * value > error));
        for (unsigned left = bits(doubt); left != 0; left &= left - 1) {
          const auto d = static_cast<std::size_t>(std::countr_zero(left));
          if (!clear_.line(numbers(a), numbers(b), numbers(c), d, double{i[d]}, double{j[d]}, sign))
            return false;
        }
      }
    }
    return true;
  }

 private:
  // F rises by 512 at most from sample to sample, and single precision resolves numbers of planes
  // of places that are a voxel away to 2^-23.
  static constexpr float kSteepest = 512;
  static constexpr float kErrorPerVoxel = kSteepest * 0x1p-21F;
  static constexpr float kAreaError = 0x1p-21F;
  static constexpr bool kIsBcc = std::is_same_v<Planes, BccPlanes>;
  // Steps of 32 bits lead 64 layers away, and on the body-centred lattice on to a centre.
  static constexpr std::ptrdiff_t kLargestLayer = 1 << (kIsBcc ? 22 : 24);
  static constexpr std::uint32_t kLastFirstCentre = 1U << 29;
  static constexpr std::size_t kFirstFamily = kIsBcc ? 3 : 0;

  // The way from a point to another: in steps, or on the body-centred lattice in half steps, and
  // whether it leads from a sample to a centre or back.
  struct Step {
    std::int32_t steps;
    std::int32_t odd;

    Step operator+(const Step& other) const { return {steps + other.steps, odd ^ other.odd}; }
  };
  struct Steps {
    Mask steps;
    Mask odd;
  };

  static Steps steps_of(const std::array<Step, kLanes>& each) {
    Steps result = {};
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      result.steps[lane] = each[lane].steps;
      result.odd[lane] = each[lane].odd;
    }
    return result;
  }

  static HWY_INLINE Steps plus(const Steps& a, const Steps& b) {
    return {a.steps + b.steps, a.odd ^ b.odd};
  }
  static HWY_INLINE Steps times(const Mask& number, const Steps& a) {
    return {number * a.steps, number & a.odd};
  }
  static HWY_INLINE Steps select(const Mask& first, const Steps& a, const Steps& b) {
    return {first ? a.steps : b.steps, first ? a.odd : b.odd};
  }
  static HWY_INLINE Steps only(const Mask& live, const Steps& a) {
    return {live & a.steps, live & a.odd};
  }

  HWY_INLINE Lanes value_after(const Steps& way) const {
    const float* const base = clear_.at_base();
    if constexpr (!kIsBcc) return gather(base, way.steps);
    return gather(base, (way.steps + (-(way.odd & 1) & to_centre_)) >> 1);
  }

  static typename Planes::Numbers numbers(const Lanes& a) {
    if constexpr (kIsBcc) {
      return Planes::numbers(Vecf{a[1] + a[2] - a[0], a[0] + a[2] - a[1], a[0] + a[1] - a[2]} *
                             0.5F);
    }
    typename Planes::Numbers result;
    std::memcpy(result.of.data(), &a, sizeof a);
    return result;
  }

  // Beside a phantom F is too steep for single precision, and on the body-centred lattice the
  // tetrahedra are others at the border.
  bool is_far_from_border(Vecf a, float most) const {
    if (!kIsBcc && field_.margin == 0) return true;
    const auto is_far = [&](float x, std::uint32_t samples) {
      const auto border = static_cast<float>(field_.margin) + (kIsBcc ? 1.5F : 0.5F) + most;
      return x > border && x < static_cast<float>(samples - 1) - border;
    };
    return is_far(a.x, field_.dims.x) && is_far(a.y, field_.dims.y) && is_far(a.z, field_.dims.z);
  }

  // F at places in planes. In each the tetrahedra are triangles as in Kuhn's split of a square.
  HWY_INLINE Lanes in_plane(const Mask& number, const Lanes& s, const Lanes& t,
                            const Mask& live) const {
    const Mask whole_s = floor_of(s);
    const Mask whole_t = floor_of(t);
    const Lanes u = s - as_lanes(whole_s);
    const Lanes v = t - as_lanes(whole_t);
    const Steps corner =
        only(live, plus(times(number, number_),
                        plus(times(whole_s, first_axis_), times(whole_t, second_axis_))));
    const Steps side = select(u >= v, first_axis_, second_axis_);
    const Lanes low = smaller(u, v);
    const Lanes high = larger(u, v);
    const Lanes p = value_after(corner);
    const Lanes q = value_after(plus(corner, side));
    const Lanes r = value_after(plus(plus(corner, first_axis_), second_axis_));
    return p + (q - p) * high + (r - q) * low;
  }

  HWY_INLINE Lanes on_line(const Lanes& i, const Lanes& j, const Lanes& k, const Mask& live) const {
    const Mask whole = floor_of(k);
    const Steps point = only(live, plus(plus(times(__builtin_convertvector(i, Mask), line_first_),
                                             times(__builtin_convertvector(j, Mask), line_second_)),
                                        times(whole, line_step_)));
    const Lanes p = value_after(point);
    const Lanes q = value_after(plus(point, line_step_));
    return p + (k - as_lanes(whole)) * (q - p);
  }

  const Field& field_;
  Clear<Planes> clear_;
  Steps number_, first_axis_, second_axis_;     // by family
  Steps line_first_, line_second_, line_step_;  // by direction
  std::int32_t to_centre_ = 0;
  const bool is_huge_;
  Lanes base_ = {};
  float least_ = 0;
  bool is_exact_ = false;
};

}  // namespace isomesh::mesh::collapse::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
