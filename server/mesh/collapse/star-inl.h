// The triangles around a vertex that is about to appear. Compiled once for each instruction set,
// see collapse_block.cpp.
#if defined(ISOMESH_STAR_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOMESH_STAR_INL_H_
#undef ISOMESH_STAR_INL_H_
#else
#define ISOMESH_STAR_INL_H_
#endif

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

#include <hwy/highway.h>

#include "server/mesh/collapse/corners.h"
#include "server/mesh/collapse/fast_clear-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::collapse::HWY_NAMESPACE {

// The data of a vertex of T that collapses need, in the metric's unit except for `copies`.
struct Site {
  std::array<float, kLanes> copies;  // as copies_of; not Lanes, which allocators may misalign
  Vecf up;                           // the way to T+
  Vecf down;                         // the way from T-
  unsigned planes = 0;               // the faces of the volume that it stays in
};

// The triangles around one vertex, which it forms with each two vertices that follow each other in
// the loop around it. In a closed star the last vertex of the loop is followed by the first. In an
// open star the edges to the first and the last vertex are edges that the surface already has. Not
// thread safe.
template <class Test>
class Star {
 public:
  struct Verdict {
    bool is_clear = false;
    std::optional<Side> failed;  // alone, and by so little that moving may help
  };

  // `reach`: how far T+ and T- are from T, in the metric's unit.
  Star(const Field& field, const Metric& metric, float reach)
      : clear_(field),
        last_(copies_of({{}, last_sample(field), last_sample(field)})),
        steps_{metric.mm(Vecf{1, 0, 0}), metric.mm(Vecf{0, 1, 0}), metric.mm(Vecf{0, 0, 1})},
        reach_(reach),
        turn_(metric.turn()) {}

  void clear() { size_ = 0; }
  // `place` is counted from some sample, the same for all.
  void add(const Site& site, Vecf place) {
    copies_[size_] = load(site.copies.data());
    planes_[size_] = site.planes;
    put(kPlace, place);
    put(kUp, site.up);
    put(kDown, site.down);
    ++size_;
  }
  void close(bool is_closed) {
    is_closed_ = is_closed;
    for (auto& each : ways_) {
      for (auto& axis : each) axis[size_] = axis[0];
    }
    planes_[size_] = planes_[0];
  }

  // No new triangle is a needle, too wide, or lies on its back: the ways from T- to T and on to T+
  // rise from its front at each corner.
  HWY_INLINE bool is_shapely(const Site& x, Vecf place) const {
    const Lanes3 at = splat3(place);
    const Lanes3 up = splat3(x.up);
    const Lanes3 down = splat3(x.down);
    for (std::size_t i = 0; i < triangles(); i += kLanes) {
      const Lanes3 a = load3(kPlace, i) - at;
      const Lanes3 b = load3(kPlace, i + 1) - at;
      const Lanes longest = larger(larger(dot(a, a), dot(b, b)), dot(b - a, b - a));
      const Lanes3 normal = turn_ * cross(a, b);
      const Lanes least = longest * splat(kLeastRise * reach_);
      Mask good = dot(normal, normal) >= longest * longest * splat(kLeastShape * kLeastShape);
      Mask upright = (dot(normal, up) > least) & (dot(normal, down) > least);
      for (const std::size_t corner : {i, i + 1}) {
        upright &=
            (dot(normal, load3(kUp, corner)) > least) & (dot(normal, load3(kDown, corner)) > least);
      }
      const unsigned live = (1U << std::min(kLanes, triangles() - i)) - 1;
      if ((live & ~bits(good)) != 0) return false;
      for (unsigned left = live & ~bits(upright); left != 0; left &= left - 1) {
        const auto lane = static_cast<std::size_t>(std::countr_zero(left));
        const Vecf inward = {normal.x[lane], normal.y[lane], normal.z[lane]};
        const unsigned planes = x.planes & planes_[i + lane] & planes_[i + lane + 1];
        if (!(rise_on_cap(planes, inward) > least[lane])) return false;
      }
    }
    return true;
  }

  bool is_clear(const Site& x) {
    if (!begin(x)) return false;
    return has_clear_edges(Side::kIn) && has_clear_edges(Side::kOut) &&
           has_clear_triangles(Side::kIn) && has_clear_triangles(Side::kOut);
  }

  // `most`: by how much of the way between x's copies a side may fail.
  Verdict judge(const Site& x, double most) {
    if (!begin(x)) return {};
    std::array<double, 2> failed = {0, 0};
    const bool in = has_clear_edges(Side::kIn);
    if (!in) failed[0] = clear_.failed();
    const bool out = has_clear_edges(Side::kOut);
    if (!out) failed[1] = clear_.failed();
    if (!in && !out) return {};
    const bool all_in = in && has_clear_triangles(Side::kIn);
    if (in && !all_in) failed[0] = clear_.failed();
    const bool all_out = out && has_clear_triangles(Side::kOut);
    if (out && !all_out) failed[1] = clear_.failed();
    if (all_in && all_out) return {.is_clear = true, .failed = {}};
    if (!all_in && !all_out) return {};
    const double way = clear_.value(center_[0]) - clear_.value(center_[1]);
    if (-std::min(failed[0], failed[1]) > most * way) return {};
    return {.is_clear = false, .failed = all_in ? Side::kOut : Side::kIn};
  }

 private:
  static constexpr std::size_t kMost = 2 * Corners::kMostNeighbours;
  static constexpr float kLeastShape =
      0.02F;  // twice a triangle's area by its longest edge's square
  // The least rise, relative to that square times the reach. Single precision can resolve it.
  static constexpr float kLeastRise = 1e-6F;
  enum Way : std::size_t { kPlace, kUp, kDown };

  static Vecf last_sample(const Field& field) {
    return narrow(Vecd{field.dims.x - 1.0, field.dims.y - 1.0, field.dims.z - 1.0});
  }
  static Lanes3 splat3(Vecf a) { return {splat(a.x), splat(a.y), splat(a.z)}; }
  HWY_INLINE Lanes3 load3(Way way, std::size_t i) const {
    const auto& [x, y, z] = ways_[way];
    return {load(&x[i]), load(&y[i]), load(&z[i])};
  }
  void put(Way way, Vecf a) {
    ways_[way][0][size_] = a.x;
    ways_[way][1][size_] = a.y;
    ways_[way][2][size_] = a.z;
  }

  std::size_t triangles() const { return size_ - (is_closed_ ? 0 : 1); }

  // How far the front of a triangle whose corners stay in a face of the volume is inside.
  float rise_on_cap(unsigned planes, Vecf normal) const {
    if (planes == 0) return 0;
    const auto face = static_cast<std::size_t>(std::countr_zero(planes));
    const float along = dot(normal, steps_[face / 2]);
    return face % 2 == 0 ? along : -along;
  }

  // Counts from x from now on.
  bool begin(const Site& x) {
    const Lanes own = load(x.copies.data());
    if (any((own < 0) | (own > last_))) return false;
    Lanes wide = {};
    for (std::size_t i = 0; i < size_; ++i) {
      wide = larger(wide, larger(copies_[i] - own, own - copies_[i]));
    }
    float most = 0;
    for (std::size_t lane = 0; lane < kLanes; ++lane) most = std::max(most, wide[lane]);
    if (!(most < kWidest)) return false;
    float apart = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      apart = std::max(apart, std::abs(x.copies[axis] - x.copies[axis + 4]));
    }
    clear_.base({x.copies[0], x.copies[1], x.copies[2]}, most + apart + 1);
    center_ = {clear_.at(own, Side::kIn), clear_.at(own, Side::kOut)};
    return true;
  }

  // x and the edges first, which most often tell.
  HWY_INLINE bool has_clear_edges(Side side) {
    const double sign = side == Side::kIn ? 1 : -1;
    const std::size_t s = side == Side::kIn ? 0 : 1;
    if (is_closed_ && !clear_.point(center_[s], sign)) return false;
    for (std::size_t i = 0; i < size_; ++i) rim_[s][i] = clear_.at(copies_[i], side);
    const std::size_t open = is_closed_ ? 0 : 1;
    for (std::size_t i = open; i + open < size_; ++i) {
      if (!clear_.edge(center_[s], rim_[s][i], sign)) return false;
    }
    return true;
  }

  HWY_INLINE bool has_clear_triangles(Side side) {
    const double sign = side == Side::kIn ? 1 : -1;
    const std::size_t s = side == Side::kIn ? 0 : 1;
    for (std::size_t i = 0; i < triangles(); ++i) {
      const std::size_t next = i + 1 < size_ ? i + 1 : 0;
      if (!clear_.inside(center_[s], rim_[s][i], rim_[s][next], sign)) return false;
    }
    return true;
  }

  using Point = typename Test::Point;
  using Axis = std::array<float, kMost + 1 + kLanes>;

  Test clear_;
  const Lanes last_;
  const std::array<Vecf, 3> steps_;
  const float reach_;
  const float turn_;
  std::size_t size_ = 0;
  bool is_closed_ = false;
  std::array<Lanes, kMost> copies_;
  std::array<unsigned, kMost + 1> planes_ = {};
  std::array<std::array<Axis, 3>, 3> ways_ = {};
  std::array<Point, 2> center_;
  std::array<std::array<Point, kMost>, 2> rim_;
};

}  // namespace isomesh::mesh::collapse::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
