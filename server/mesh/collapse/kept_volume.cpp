#include "server/mesh/collapse/kept_volume.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "server/mesh/collapse/caps.h"
#include "server/mesh/collapse/left_surface.h"
#include "server/mesh/collapse/swept.h"
#include "server/mesh/measure/extent-inl.h"
#include "server/mesh/measure/point_triangle.h"
#include "server/mesh/parallel.h"
#include "server/mesh/points.h"

namespace isomesh::mesh::collapse {
namespace {

constexpr std::uint64_t kLow = 0xffffffff;  // of a pair of numbers
constexpr int kMostAttempts = 3;
// Curves move first, because the walls between them make up for what is left.
constexpr std::array kMovesCurves = {true, false, true, false, true, false, false};
constexpr double kMostOfEdge = 0.5;
constexpr double kMostOfBound = 0.95;
// The least area by which a lost volume is divided, as a share of the triangles' areas: normals of
// a fold nearly cancel each other.
constexpr double kLeastFlatness = 0.3;
constexpr double kHold = 0.1;  // of least squares, where walls hardly say where to go
constexpr int kMostPulls = 8;  // of vertices whose triangles turn; the last one goes all the way

// True if moved corners turn a triangle too far, or leave it no area.
bool turns(const Corners& before, const Corners& after) {
  const Point old = normal_of(before[0], before[1], before[2]);
  const Point normal = normal_of(after[0], after[1], after[2]);
  const double lengths = std::sqrt(dot(old, old) * dot(normal, normal));
  if (!(lengths > 0 && dot(old, normal) >= kLeastCosineOfMoves * lengths)) return true;
  return has_no_area(rounded(after[0]), rounded(after[1]), rounded(after[2]));
}

class Mover {
 public:
  Mover(const Mesh& mesh, std::span<const WallSides> sides, const History& history,
        std::span<const std::uint8_t> is_held, double most_mm, const Context& context)
      : mesh_(mesh),
        context_(context),
        most_mm_(most_mm),
        left_(mesh, sides, history, context),
        caps_(mesh, triangles_left()),
        slots_(left_.slots()),
        lost_(left_.walls(), 0),
        of_triangles_(triangles().size()),
        is_held_(vertices(), 0),
        way_(vertices(), Point{0, 0, 0}) {
    find_fixed(!sides.empty());
    if (!is_held.empty()) {
      for (std::size_t n = 0; n < vertices(); ++n) is_held_[n] = is_held[left_.vertices()[n]];
    }
    find_limits();
    find_owed();
  }

  void run(std::vector<Vec3>& places) {
    start(places);
    for (int attempt = 0; attempt < kMostAttempts; ++attempt) {
      for (const bool moves_curves : kMovesCurves) {
        context_.throw_if_stopped();
        measure();
        if (!moves_curves) spread();
        move(moves_curves);
      }
      if (!straighten()) break;
    }
    for (std::size_t n = 0; n < vertices(); ++n) places[left_.vertices()[n]] = rounded(place(n));
  }

 private:
  // A vertex in one of its walls.
  struct Slot {
    Point area = {0, 0, 0};  // a third of its triangles' areas, with their normals
    double whole = 0;        // the same without normals
    double owed = 0;         // the volume that its surroundings have moved in front
  };
  using LeftTriangle = LeftSurface::LeftTriangle;

  // From where the vertices are.
  void start(std::span<const Vec3> places) {
    const std::vector<Point> before = way_;
    for (std::size_t n = 0; n < vertices(); ++n) {
      way_[n] = minus(to_point(places[left_.vertices()[n]]), own_place(n));
    }
    pay(before);
  }

  std::size_t vertices() const { return left_.vertices().size(); }
  std::span<const LeftTriangle> triangles() const { return left_.triangles(); }

  std::vector<Triangle> triangles_left() const {
    std::vector<Triangle> triangles;
    if (mesh_.on_border.empty()) return triangles;
    for (const LeftTriangle& triangle : left_.triangles()) {
      const auto& [a, b, c] = triangle.corners;
      triangles.push_back({left_.vertices()[a], left_.vertices()[b], left_.vertices()[c]});
    }
    return triangles;
  }

  std::span<const Slot> slots_at(std::size_t n) const {
    return std::span(slots_).subspan(left_.first_slot(n), left_.slot_count(n));
  }

  bool is_on_curve(std::size_t n) const {
    return left_.slot_count(n) > 1 || mesh_.is_on_line(left_.vertices()[n]);
  }

  // Caps stay flat. The ends of open surfaces stay in the border of the volume, and what is beside
  // them does not move across it. Junction curves whose walls are not known stay.
  void find_fixed(bool moves_curves) {
    is_fixed_.reserve(vertices());
    for (const std::uint32_t v : left_.vertices()) {
      const bool is_held = mesh_.is_on_border(v) || (!moves_curves && mesh_.is_on_line(v));
      is_fixed_.push_back(is_held ? 1 : 0);
    }
    if (!mesh_.on_border.empty()) return;  // Closed surfaces have no ends.
    std::vector<std::uint64_t> edges;
    edges.reserve(3 * triangles().size());
    for (const LeftTriangle& triangle : triangles()) {
      for (std::size_t i = 0; i < 3; ++i) {
        const auto [low, high] =
            std::minmax(triangle.corners[i], triangle.corners[i == 2 ? 0 : i + 1]);
        edges.push_back(std::uint64_t{low} << 32 | high);
      }
    }
    std::ranges::sort(edges);
    std::vector<std::uint8_t> is_end(vertices(), 0);
    for (std::size_t i = 0; i < edges.size(); ++i) {
      const bool is_alone = (i == 0 || edges[i] != edges[i - 1]) &&
                            (i + 1 == edges.size() || edges[i] != edges[i + 1]);
      if (is_alone) is_end[edges[i] >> 32] = is_end[edges[i] & kLow] = 1;
    }
    for (const std::uint64_t edge : edges) {
      if ((is_end[edge >> 32] | is_end[edge & kLow]) == 0) continue;
      is_fixed_[edge >> 32] = is_fixed_[edge & kLow] = 1;
    }
  }

  void find_limits() {
    limits_.assign(vertices(), kMostOfBound * most_mm_);
    for (const LeftTriangle& triangle : triangles()) {
      for (std::size_t i = 0; i < 3; ++i) {
        const std::uint32_t a = triangle.corners[i];
        const std::uint32_t b = triangle.corners[i == 2 ? 0 : i + 1];
        const double most = kMostOfEdge * length(minus(place(a), place(b)));
        limits_[a] = std::min(limits_[a], most);
        limits_[b] = std::min(limits_[b], most);
      }
    }
  }

  // The volume that collapses have swept.
  void find_owed() {
    std::vector<std::array<float, 3>> swept_by(mesh_.triangles.size());
    for_each(context_, swept_by.size(), [&](std::size_t t) {
      Corners to;
      for (std::size_t i = 0; i < 3; ++i) {
        to[i] = to_point(mesh_.positions[left_.kept(mesh_.triangles[t][i])]);
      }
      const std::array<double, 3> volumes = swept(corners_of(mesh_, t), to);
      swept_by[t] = {static_cast<float>(volumes[0]), static_cast<float>(volumes[1]),
                     static_cast<float>(volumes[2])};
    });
    for (std::size_t t = 0; t < swept_by.size(); ++t) {
      for (std::size_t i = 0; i < 3; ++i) {
        const double volume = double{swept_by[t][i]};
        if (volume == 0) continue;
        const std::uint32_t wall = left_.wall_of(t);
        const std::uint32_t slot = left_.slot_of_kept(mesh_.triangles[t][i], wall);
        (slot == LeftSurface::kNone ? lost_[wall] : slots_[slot].owed) += volume;
      }
    }
  }

  Point own_place(std::size_t n) const { return to_point(mesh_.positions[left_.vertices()[n]]); }
  Point place(std::size_t n) const { return plus(own_place(n), way_[n]); }

  Corners places(const LeftTriangle& triangle) const {
    const auto& [a, b, c] = triangle.corners;
    return {place(a), place(b), place(c)};
  }

  void measure() {
    for_each(context_, triangles().size(),
             [&](std::size_t t) { of_triangles_[t] = third_of_area(places(triangles()[t])); });
    for_each(context_, slots_.size(), [&](std::size_t slot) {
      Point area = {0, 0, 0};
      double whole = 0;
      for (const std::uint32_t corner : left_.corners_at(slot)) {
        area = plus(area, of_triangles_[corner / 3]);
        whole += length(of_triangles_[corner / 3]);
      }
      slots_[slot].area = area;
      slots_[slot].whole = whole;
    });
  }

  // May move along its normal.
  bool is_free(std::size_t n) const {
    return is_fixed_[n] == 0 && is_held_[n] == 0 && !is_on_curve(n);
  }

  std::size_t free_corners(const LeftTriangle& triangle) const {
    return static_cast<std::size_t>(
        std::ranges::count_if(triangle.corners, [&](std::uint32_t n) { return is_free(n); }));
  }

  // The part of a triangle in what its corners owe. Its area is measured.
  double owed_by(std::size_t triangle) const {
    const double area = length(of_triangles_[triangle]);
    double owed = 0;
    for (const std::uint32_t slot : triangles()[triangle].slots) {
      if (slots_[slot].whole > 0) owed += slots_[slot].owed * area / slots_[slot].whole;
    }
    return owed;
  }

  // Each vertex hands what it owes to its triangles, and they hand it to their free corners; where
  // they have none, to the whole wall; and where that has none, to its curves.
  void spread() {
    std::vector<double> areas(left_.walls(), 0);  // of what is free
    for_each_free([&](std::size_t slot) { areas[left_.wall_of_slot(slot)] += slots_[slot].whole; });
    std::vector<double> owed(triangles().size());  // by a corner
    for_each(context_, owed.size(), [&](std::size_t t) { owed[t] = owed_by(t); });
    for (std::size_t t = 0; t < owed.size(); ++t) {
      const std::size_t free = free_corners(triangles()[t]);
      const std::uint32_t wall = left_.wall_of_slot(triangles()[t].slots[0]);
      const bool is_for_wall = free == 0 && areas[wall] > 0;
      if (is_for_wall) lost_[wall] += std::exchange(owed[t], 0);
      owed[t] /= static_cast<double>(free > 0 ? free : 3);
    }
    for_each(context_, slots_.size(), [&](std::size_t slot) {
      slots_[slot].owed = 0;
      for (const std::uint32_t corner : left_.corners_at(slot)) {
        const LeftTriangle& triangle = triangles()[corner / 3];
        const bool has_share = is_free(triangle.corners[corner % 3]) || free_corners(triangle) == 0;
        if (has_share) slots_[slot].owed += owed[corner / 3];
      }
    });
    for_each_free([&](std::size_t slot) {
      const std::uint32_t wall = left_.wall_of_slot(slot);
      if (areas[wall] > 0) slots_[slot].owed += lost_[wall] * slots_[slot].whole / areas[wall];
    });
    for (std::size_t wall = 0; wall < areas.size(); ++wall) {
      if (areas[wall] > 0) lost_[wall] = 0;
    }
  }

  // Calls visit(slot) for the only slot of each.
  template <class Visit>
  void for_each_free(Visit visit) const {
    for (std::size_t n = 0; n < vertices(); ++n) {
      if (is_free(n)) visit(left_.first_slot(n));
    }
  }

  // Moves the vertices of curves, or the others.
  void move(bool moves_curves) {
    const std::vector<Point> before = way_;
    for_each(context_, vertices(), [&](std::size_t n) {
      if (is_fixed_[n] != 0 || is_held_[n] != 0 || is_on_curve(n) != moves_curves) return;
      const Point step = moves_curves ? least_squares(slots_at(n)) : along_normal(slots_at(n)[0]);
      limit(n, plus(way_[n], step));
    });
    pay(before);
  }

  // The way becomes this one, or so much of it that no limit is broken.
  void limit(std::size_t n, const Point& way) {
    const double most = length(way);
    if (!std::isfinite(most)) return;
    double share = most > limits_[n] ? limits_[n] / most : 1;
    share *= caps_.share_of_way(own_place(n), scaled(way, share));
    is_held_[n] = share < 1 ? 1 : 0;
    way_[n] = scaled(way, share);
  }

  // Ways have changed.
  void pay(std::span<const Point> before) {
    for_each(context_, triangles().size(), [&](std::size_t t) {
      Corners from;
      for (std::size_t i = 0; i < 3; ++i) {
        const std::uint32_t n = triangles()[t].corners[i];
        from[i] = plus(own_place(n), before[n]);
      }
      of_triangles_[t] = swept(from, places(triangles()[t]));
    });
    for_each(context_, slots_.size(), [&](std::size_t slot) {
      for (const std::uint32_t corner : left_.corners_at(slot)) {
        slots_[slot].owed += of_triangles_[corner / 3][corner % 3];
      }
    });
  }

  static Point along_normal(const Slot& slot) {
    const double area = length(slot.area);
    if (!(area > 0)) return {0, 0, 0};
    return scaled(slot.area, -slot.owed / (area * std::max(area, kLeastFlatness * slot.whole)));
  }

  // The way that makes up best for what all walls owe.
  static Point least_squares(std::span<const Slot> slots) {
    std::array<Point, 3> rows = {};
    Point right = {0, 0, 0};
    double trace = 0;
    for (const Slot& slot : slots) {
      for (std::size_t i = 0; i < 3; ++i) {
        rows[i] = plus(rows[i], scaled(slot.area, slot.area[i]));
      }
      right = minus(right, scaled(slot.area, slot.owed));
      trace += slot.whole * slot.whole;
    }
    for (std::size_t i = 0; i < 3; ++i) rows[i][i] += kHold * trace;
    const Point column = cross(rows[1], rows[2]);
    const double determinant = dot(rows[0], column);
    if (!(determinant > 0)) return {0, 0, 0};
    // The matrix is symmetric.
    const Point sum =
        plus(plus(scaled(column, right[0]), scaled(cross(rows[2], rows[0]), right[1])),
             scaled(cross(rows[0], rows[1]), right[2]));
    return scaled(sum, 1 / determinant);
  }

  // Takes vertices back where triangles turn, and holds them; returns true if there were any.
  bool straighten() {
    const std::vector<Point> before = way_;
    std::vector<std::uint8_t> is_pulled(vertices());
    std::vector<std::uint8_t> turned(triangles().size());
    bool is_any = false;
    for (int pull = 1; pull <= kMostPulls; ++pull) {
      for_each(context_, triangles().size(),
               [&](std::size_t t) { turned[t] = is_turned(triangles()[t]) ? 1 : 0; });
      if (std::ranges::find(turned, 1) == turned.end()) break;
      is_any = true;
      std::ranges::fill(is_pulled, 0);
      for (std::size_t t = 0; t < triangles().size(); ++t) {
        if (turned[t] == 0) continue;
        for (const std::uint32_t n : triangles()[t].corners) is_pulled[n] = 1;
      }
      for (std::size_t n = 0; n < vertices(); ++n) {
        if (is_pulled[n] == 0) continue;
        is_held_[n] = 1;
        way_[n] = scaled(way_[n], pull < kMostPulls ? 0.5 : 0);
      }
    }
    if (is_any) pay(before);
    return is_any;
  }

  bool is_turned(const LeftTriangle& triangle) const {
    Corners before;
    bool is_moved = false;
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint32_t n = triangle.corners[i];
      before[i] = own_place(n);
      is_moved = is_moved || way_[n] != Point{0, 0, 0};
    }
    return is_moved && turns(before, places(triangle));
  }

  const Mesh& mesh_;
  const Context& context_;
  const double most_mm_;
  const LeftSurface left_;
  const Caps caps_;
  std::vector<Slot> slots_;
  std::vector<double> lost_;  // of each wall: volume that no vertex owes
  // In each round, a third of the area with its normal, and then the volume swept by each corner.
  std::vector<std::array<double, 3>> of_triangles_;
  std::vector<std::uint8_t> is_fixed_;
  std::vector<std::uint8_t> is_held_;  // where they are, at a limit
  std::vector<double> limits_;         // millimetres
  std::vector<Point> way_;             // from its own place
};

}  // namespace

void keep_volume(const Mesh& mesh, std::span<const WallSides> sides, const History& history,
                 std::span<const std::uint8_t> is_held, double most_mm, const Context& context,
                 std::vector<Vec3>& places) {
  Mover(mesh, sides, history, is_held, most_mm, context).run(places);
}

bool is_turned(const Mesh& mesh, std::span<const Vec3> places, const Triangle& corners) {
  Corners before;
  Corners after;
  bool is_moved = false;
  for (std::size_t i = 0; i < 3; ++i) {
    before[i] = to_point(mesh.positions[corners[i]]);
    after[i] = to_point(places[corners[i]]);
    is_moved = is_moved || before[i] != after[i];
  }
  return is_moved && turns(before, after);
}

}  // namespace isomesh::mesh::collapse
