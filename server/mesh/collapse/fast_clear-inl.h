// Clear for the six-way split in eight lanes. Compiled once for each instruction set, see
// collapse_block.cpp.
//
// The lanes are families of planes, or directions of lines. Each sign is told in single precision
// where it is far enough from zero for that, and by Clear where it is not: the answers are the
// same.
#if defined(ISOMESH_FAST_CLEAR_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_FAST_CLEAR_INL_H_
#undef ISOMESH_FAST_CLEAR_INL_H_
#else
#define ISOMESH_FAST_CLEAR_INL_H_
#endif

#include <bit>
#include <cstddef>
#include <cstdint>

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

// Clear for any planes, as FastClear is for six.
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

class FastClear {
 public:
  explicit FastClear(const Field& field)
      : field_(field), clear_(field), is_huge_(field.step_z() > kLargestLayer) {
    const auto x = 1;
    const auto y = static_cast<std::int32_t>(field.step_y());
    const auto z = static_cast<std::int32_t>(field.step_z());
    // A plane's samples: `number_` steps for its number, then along its two axes.
    number_ = Mask{x, y, z, x, y, x, 0, 0};
    first_axis_ = Mask{y, x, x, x + y, y + z, x + z, 0, 0};
    second_axis_ = Mask{z, z, y, z, x, y, 0, 0};
    line_first_ = Mask{y, x, x, x, x, y, x, 0};
    line_second_ = Mask{z, z, y, z, y, x, x + y, 0};
    line_step_ = Mask{x, y, z, x + y, x + z, y + z, x + y + z, 0};
  }

  using Point = Lanes;

  // Places of which at() is taken from now on are within `most` voxels of `a` along each axis.
  void base(Vecf a, float most) {
    const Vecf base = clear_.base(a);
    base_ = copies_of({{}, base, base});
    // Beside a phantom F is too steep for single precision.
    is_exact_ = is_huge_ || !is_far_from_phantoms(a, most);
    least_ = kErrorPerVoxel * (1 + 2 * most);
  }
  HWY_INLINE Lanes at(const Lanes& copies, Side side) const {
    const Lanes d = copies - base_;
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
        if (!clear_.crossing(numbers(a), numbers(b), k, double{plane[k]}, sign)) return false;
      }
      plane += 1;
      crosses = plane < high;
    } while (any(crosses));
    return true;
  }

  // Lanes are directions.
  HWY_INLINE bool inside(const Lanes& a, const Lanes& b, const Lanes& c, double sign) {
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
  static constexpr std::ptrdiff_t kLargestLayer = 1 << 24;  // steps of 32 bits lead 64 layers away

  static SixPlanes::Numbers numbers(const Lanes& a) {
    SixPlanes::Numbers result;
    std::memcpy(result.of.data(), &a, sizeof a);
    return result;
  }

  bool is_far_from_phantoms(Vecf a, float most) const {
    if (field_.margin == 0) return true;
    const auto is_far = [&](float x, std::uint32_t samples) {
      const auto border = static_cast<float>(field_.margin) + 0.5F + most;
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
    const Mask corner = live & (number * number_ + whole_s * first_axis_ + whole_t * second_axis_);
    const Mask side = u >= v ? first_axis_ : second_axis_;
    const Lanes low = smaller(u, v);
    const Lanes high = larger(u, v);
    const float* const base = clear_.at_base();
    const Lanes p = gather(base, corner);
    const Lanes q = gather(base, corner + side);
    const Lanes r = gather(base, corner + first_axis_ + second_axis_);
    return p + (q - p) * high + (r - q) * low;
  }

  HWY_INLINE Lanes on_line(const Lanes& i, const Lanes& j, const Lanes& k, const Mask& live) const {
    const Mask whole = floor_of(k);
    const Mask sample =
        live & (__builtin_convertvector(i, Mask) * line_first_ +
                __builtin_convertvector(j, Mask) * line_second_ + whole * line_step_);
    const float* const base = clear_.at_base();
    const Lanes p = gather(base, sample);
    const Lanes q = gather(base, sample + line_step_);
    return p + (k - as_lanes(whole)) * (q - p);
  }

  const Field& field_;
  Clear<SixPlanes> clear_;
  Mask number_, first_axis_, second_axis_;     // by family
  Mask line_first_, line_second_, line_step_;  // by direction
  const bool is_huge_;
  Lanes base_ = {};
  float least_ = 0;
  bool is_exact_ = false;
};

}  // namespace isomesh::mesh::collapse::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
