#include "server/mesh/collapse/kept_volume.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <numeric>

#include "server/mesh/collapse/swept.h"
#include "server/mesh/measure/extent-inl.h"
#include "server/mesh/measure/point_triangle.h"
#include "server/mesh/parallel.h"
#include "server/mesh/points.h"

namespace isomesh::mesh::collapse {
namespace {

constexpr std::uint32_t kNone = ~std::uint32_t{0};
// Curves move first, because the walls between them make up for what is left.
constexpr std::array kMovesCurves = {true, false, true, false, true, false, false};
constexpr double kMostOfEdge = 0.5;
constexpr double kMostOfBound = 0.95;
// The least area by which a lost volume is divided, as a share of the triangles' areas: normals of
// a fold nearly cancel each other.
constexpr double kLeastFlatness = 0.3;
constexpr double kHold = 0.1;  // of least squares, where walls hardly say where to go
// Triangles that tell the plane of a cap are no needles, and those of one plane differ by so
// little.
constexpr double kLeastShapeOfCap = 0.02;  // twice the area by the square of an edge
constexpr double kLeastCosineOfCap = 0.9999;
constexpr double kDepthOfCap = 1e-3;  // as a share of an edge
constexpr std::size_t kMostCaps = 64;
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
  Mover(const Mesh& mesh, std::span<const WallSides> sides, const History& history, double most_mm,
        const Context& context)
      : mesh_(mesh), context_(context), most_mm_(most_mm) {
    find_walls(sides);
    find_left(history);
    make_slots();
    find_fixed();
    find_caps();
    find_limits();
    find_owed();
  }

  std::vector<Vec3> run() {
    of_triangles_.resize(triangles_.size());
    for (const bool moves_curves : kMovesCurves) {
      context_.throw_if_stopped();
      measure();
      if (!moves_curves) spread();
      move(moves_curves);
    }
    straighten();
    std::vector<Vec3> places(mesh_.positions.begin(), mesh_.positions.end());
    for (std::size_t n = 0; n < left_.size(); ++n) {
      if (way_[n] != Point{0, 0, 0}) places[left_[n]] = rounded(place(n));
    }
    return places;
  }

 private:
  // A vertex in one of its walls.
  struct Slot {
    std::uint32_t wall = 0;
    Point area = {0, 0, 0};  // a third of its triangles' areas, with their normals
    double whole = 0;        // the same without normals
    double owed = 0;         // the volume that its surroundings have moved in front
  };
  struct Cap {
    Point normal;
    double offset = 0;
  };
  // By number of the vertices that are left.
  struct LeftTriangle {
    Triangle corners;
    std::array<std::uint32_t, 3> slots;
  };

  static void make_set(std::vector<WallSides>& walls) {
    std::ranges::sort(walls);
    walls.erase(std::unique(walls.begin(), walls.end()), walls.end());
  }

  void find_walls(std::span<const WallSides> sides) {
    // Neighbours are of one wall as a rule, so few are sorted.
    std::vector<std::vector<WallSides>> found(chunks_of(sides.size()));
    for_chunks(context_, sides.size(), [&](std::size_t begin, std::size_t end) {
      std::vector<WallSides>& walls = found[begin / kChunk];
      std::ranges::unique_copy(sides.subspan(begin, end - begin), std::back_inserter(walls));
      make_set(walls);
    });
    for (const auto& walls : found) walls_.insert(walls_.end(), walls.begin(), walls.end());
    make_set(walls_);
    wall_of_.resize(sides.size());
    for_each(context_, sides.size(), [&](std::size_t t) {
      const auto wall = std::ranges::lower_bound(walls_, sides[t]);
      wall_of_[t] = static_cast<std::uint32_t>(wall - walls_.begin());
    });
    if (walls_.empty()) walls_.emplace_back();
    lost_.assign(walls_.size(), 0);
  }

  std::uint32_t wall_of(std::size_t triangle) const {
    return wall_of_.empty() ? 0 : wall_of_[triangle];
  }

  void find_left(const History& history) {
    const std::size_t count = mesh_.positions.size();
    kept_.resize(count);
    for_each(context_, count,
             [&](std::size_t v) { kept_[v] = history.kept(static_cast<std::uint32_t>(v)); });
    number_.assign(count, kNone);
    const auto corners_left = [&](const Triangle& triangle) {
      return Triangle{kept_[triangle[0]], kept_[triangle[1]], kept_[triangle[2]]};
    };
    const auto is_left = [](const Triangle& corners) {
      return corners[0] != corners[1] && corners[1] != corners[2] && corners[2] != corners[0];
    };
    const auto triangles = std::ranges::count_if(
        mesh_.triangles, [&](const Triangle& each) { return is_left(corners_left(each)); });
    triangles_.reserve(static_cast<std::size_t>(triangles));
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
      const Triangle corners = corners_left(mesh_.triangles[t]);
      if (!is_left(corners)) continue;
      for (const std::uint32_t v : corners) number_[v] = 0;
      triangles_.push_back({corners, {wall_of(t), 0, 0}});
    }
    left_.reserve(count - static_cast<std::size_t>(std::ranges::count(number_, kNone)));
    for (std::uint32_t v = 0; v < count; ++v) {
      if (number_[v] == kNone) continue;
      number_[v] = static_cast<std::uint32_t>(left_.size());
      left_.push_back(v);
    }
    for (LeftTriangle& triangle : triangles_) {
      for (std::uint32_t& corner : triangle.corners) corner = number_[corner];
    }
    way_.assign(left_.size(), Point{0, 0, 0});
  }

  void make_slots() {
    std::vector<std::size_t> begins(left_.size() + 1, 0);
    for (const LeftTriangle& triangle : triangles_) {
      for (const std::uint32_t n : triangle.corners) ++begins[n + 1];
    }
    std::partial_sum(begins.begin(), begins.end(), begins.begin());
    std::vector<std::uint32_t> walls(begins.back());
    std::vector<std::uint32_t> counts(left_.size(), 0);
    for (const LeftTriangle& triangle : triangles_) {
      const std::uint32_t wall = triangle.slots[0];
      for (const std::uint32_t n : triangle.corners) {
        const auto begin = walls.begin() + static_cast<std::ptrdiff_t>(begins[n]);
        const auto end = begin + counts[n];
        if (std::find(begin, end, wall) != end) continue;
        *end = wall;
        ++counts[n];
      }
    }
    first_slot_.reserve(left_.size() + 1);
    slots_.reserve(std::accumulate(counts.begin(), counts.end(), std::size_t{0}));
    for (std::size_t n = 0; n < left_.size(); ++n) {
      first_slot_.push_back(static_cast<std::uint32_t>(slots_.size()));
      for (std::size_t k = 0; k < counts[n]; ++k) slots_.push_back({.wall = walls[begins[n] + k]});
    }
    first_slot_.push_back(static_cast<std::uint32_t>(slots_.size()));
    for (LeftTriangle& triangle : triangles_) {
      const std::uint32_t wall = triangle.slots[0];
      for (std::size_t i = 0; i < 3; ++i) triangle.slots[i] = slot_of(triangle.corners[i], wall);
    }
  }

  // The number of a vertex's slot in a wall; kNone if it has none.
  std::uint32_t slot_of(std::uint32_t number, std::uint32_t wall) const {
    for (std::uint32_t slot = first_slot_[number]; slot < first_slot_[number + 1]; ++slot) {
      if (slots_[slot].wall == wall) return slot;
    }
    return kNone;
  }

  std::span<const Slot> slots_at(std::size_t n) const {
    return std::span(slots_).subspan(first_slot_[n], first_slot_[n + 1] - first_slot_[n]);
  }

  bool is_on_curve(std::size_t n) const {
    return slots_at(n).size() > 1 || mesh_.is_on_line(left_[n]);
  }

  // Caps stay flat. The ends of open surfaces stay in the border of the volume, and what is beside
  // them does not move across it. Junction curves whose walls are not known stay.
  void find_fixed() {
    const bool holds_curves = wall_of_.empty();
    is_fixed_.reserve(left_.size());
    for (const std::uint32_t v : left_) {
      const bool is_held = mesh_.is_on_border(v) || (holds_curves && mesh_.is_on_line(v));
      is_fixed_.push_back(is_held ? 1 : 0);
    }
    if (!mesh_.on_border.empty()) return;  // Closed surfaces have no ends.
    std::vector<std::uint64_t> edges;
    edges.reserve(3 * triangles_.size());
    for (const LeftTriangle& triangle : triangles_) {
      for (std::size_t i = 0; i < 3; ++i) {
        const auto [low, high] =
            std::minmax(triangle.corners[i], triangle.corners[i == 2 ? 0 : i + 1]);
        edges.push_back(std::uint64_t{low} << 32 | high);
      }
    }
    std::ranges::sort(edges);
    std::vector<std::uint8_t> is_end(left_.size(), 0);
    for (std::size_t i = 0; i < edges.size(); ++i) {
      const bool is_alone = (i == 0 || edges[i] != edges[i - 1]) &&
                            (i + 1 == edges.size() || edges[i] != edges[i + 1]);
      if (is_alone) is_end[edges[i] >> 32] = is_end[edges[i] & kNone] = 1;
    }
    for (const std::uint64_t edge : edges) {
      if ((is_end[edge >> 32] | is_end[edge & kNone]) == 0) continue;
      is_fixed_[edge >> 32] = is_fixed_[edge & kNone] = 1;
    }
  }

  // The planes of caps, which nothing crosses.
  void find_caps() {
    if (mesh_.on_border.empty()) return;
    for (const LeftTriangle& triangle : triangles_) {
      const bool is_cap = std::ranges::all_of(
          triangle.corners, [&](std::uint32_t n) { return mesh_.is_on_border(left_[n]); });
      if (!is_cap) continue;
      const Corners corners = places(triangle);
      const Point normal = normal_of(corners[0], corners[1], corners[2]);
      const Point edge = minus(corners[1], corners[0]);
      const double area = length(normal);
      if (!(area > kLeastShapeOfCap * dot(edge, edge))) continue;
      const Point unit = scaled(normal, 1 / area);
      const double offset = dot(unit, corners[0]);
      const bool is_known = std::ranges::any_of(caps_, [&](const Cap& cap) {
        return dot(cap.normal, unit) > kLeastCosineOfCap &&
               std::abs(cap.offset - offset) < kDepthOfCap * length(edge);
      });
      if (!is_known && caps_.size() < kMostCaps) caps_.push_back({unit, offset});
    }
  }

  // The way, or so much of it that no limit is broken.
  Point limited(std::size_t n, const Point& way) const {
    const double most = length(way);
    if (!std::isfinite(most)) return way_[n];
    double share = most > limits_[n] ? limits_[n] / most : 1;
    const Point own = to_point(mesh_.positions[left_[n]]);
    for (const Cap& cap : caps_) {
      const double height = dot(cap.normal, own) - cap.offset;
      const double rise = dot(cap.normal, way);
      if (height < 0 && share * rise > -height / 2) share = -height / (2 * rise);
    }
    return share < 1 ? scaled(way, share) : way;
  }

  void find_limits() {
    limits_.assign(left_.size(), kMostOfBound * most_mm_);
    for (const LeftTriangle& triangle : triangles_) {
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
        to[i] = to_point(mesh_.positions[kept_[mesh_.triangles[t][i]]]);
      }
      const std::array<double, 3> volumes = swept(corners_of(mesh_, t), to);
      swept_by[t] = {static_cast<float>(volumes[0]), static_cast<float>(volumes[1]),
                     static_cast<float>(volumes[2])};
    });
    for (std::size_t t = 0; t < swept_by.size(); ++t) {
      for (std::size_t i = 0; i < 3; ++i) {
        const double volume = double{swept_by[t][i]};
        if (volume == 0) continue;
        const std::uint32_t number = number_[kept_[mesh_.triangles[t][i]]];
        const std::uint32_t slot = number == kNone ? kNone : slot_of(number, wall_of(t));
        (slot == kNone ? lost_[wall_of(t)] : slots_[slot].owed) += volume;
      }
    }
  }

  Point place(std::size_t n) const { return plus(to_point(mesh_.positions[left_[n]]), way_[n]); }

  Corners places(const LeftTriangle& triangle) const {
    const auto& [a, b, c] = triangle.corners;
    return {place(a), place(b), place(c)};
  }

  void measure() {
    for (Slot& slot : slots_) {
      slot.area = {0, 0, 0};
      slot.whole = 0;
    }
    for_each(context_, triangles_.size(),
             [&](std::size_t t) { of_triangles_[t] = third_of_area(places(triangles_[t])); });
    for (std::size_t t = 0; t < triangles_.size(); ++t) {
      const Point& area = of_triangles_[t];
      const double whole = length(area);
      for (const std::uint32_t slot : triangles_[t].slots) {
        slots_[slot].area = plus(slots_[slot].area, area);
        slots_[slot].whole += whole;
      }
    }
  }

  bool is_free(std::size_t n) const { return is_fixed_[n] == 0 && !is_on_curve(n); }

  // Each vertex hands what it owes to its triangles, and they hand it to their free corners; where
  // they have none, to the whole wall; and where that has none, to its curves.
  void spread() {
    std::vector<double> given(slots_.size(), 0);
    std::vector<double> areas(walls_.size(), 0);  // of what is free
    for_each_free([&](std::size_t n) {
      const Slot& slot = slots_[first_slot_[n]];
      areas[slot.wall] += slot.whole;
    });
    for (std::size_t t = 0; t < triangles_.size(); ++t) {
      const LeftTriangle& triangle = triangles_[t];
      const double area = length(of_triangles_[t]);  // as measured
      double owed = 0;
      std::size_t free = 0;
      for (std::size_t i = 0; i < 3; ++i) {
        const Slot& slot = slots_[triangle.slots[i]];
        if (slot.whole > 0) owed += slot.owed * area / slot.whole;
        if (is_free(triangle.corners[i])) ++free;
      }
      const std::uint32_t wall = slots_[triangle.slots[0]].wall;
      const bool is_for_wall = free == 0 && areas[wall] > 0;
      if (is_for_wall) lost_[wall] += owed;
      if (is_for_wall) continue;
      for (std::size_t i = 0; i < 3; ++i) {
        if (free > 0 && !is_free(triangle.corners[i])) continue;
        given[triangle.slots[i]] += owed / static_cast<double>(free > 0 ? free : 3);
      }
    }
    for (std::size_t slot = 0; slot < slots_.size(); ++slot) slots_[slot].owed = given[slot];
    for_each_free([&](std::size_t n) {
      Slot& slot = slots_[first_slot_[n]];
      if (areas[slot.wall] > 0) slot.owed += lost_[slot.wall] * slot.whole / areas[slot.wall];
    });
    for (std::size_t wall = 0; wall < areas.size(); ++wall) {
      if (areas[wall] > 0) lost_[wall] = 0;
    }
  }

  template <class Visit>
  void for_each_free(Visit visit) const {
    for (std::size_t n = 0; n < left_.size(); ++n) {
      if (is_free(n)) visit(n);
    }
  }

  // Moves the vertices of curves, or the others.
  void move(bool moves_curves) {
    const std::vector<Point> before = way_;
    for_each(context_, left_.size(), [&](std::size_t n) {
      if (is_fixed_[n] != 0 || is_on_curve(n) != moves_curves) return;
      const Point step = moves_curves ? least_squares(slots_at(n)) : along_normal(slots_at(n)[0]);
      way_[n] = limited(n, plus(way_[n], step));
    });
    for_each(context_, triangles_.size(), [&](std::size_t t) {
      Corners from;
      for (std::size_t i = 0; i < 3; ++i) {
        const std::uint32_t n = triangles_[t].corners[i];
        from[i] = plus(to_point(mesh_.positions[left_[n]]), before[n]);
      }
      of_triangles_[t] = swept(from, places(triangles_[t]));
    });
    for (std::size_t t = 0; t < triangles_.size(); ++t) {
      const auto& slots = triangles_[t].slots;
      for (std::size_t i = 0; i < 3; ++i) slots_[slots[i]].owed += of_triangles_[t][i];
    }
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

  // Takes vertices back where triangles turn.
  void straighten() {
    std::vector<std::uint8_t> is_pulled(left_.size());
    std::vector<std::uint8_t> turned(triangles_.size());
    for (int pull = 1; pull <= kMostPulls; ++pull) {
      std::ranges::fill(is_pulled, 0);
      bool is_any = false;
      for_each(context_, triangles_.size(),
               [&](std::size_t t) { turned[t] = is_turned(triangles_[t]) ? 1 : 0; });
      for (std::size_t t = 0; t < triangles_.size(); ++t) {
        if (turned[t] == 0) continue;
        for (const std::uint32_t n : triangles_[t].corners) is_pulled[n] = 1;
        is_any = true;
      }
      if (!is_any) return;
      for (std::size_t n = 0; n < left_.size(); ++n) {
        if (is_pulled[n] != 0) way_[n] = scaled(way_[n], pull < kMostPulls ? 0.5 : 0);
      }
    }
  }

  bool is_turned(const LeftTriangle& triangle) const {
    Corners before;
    bool is_moved = false;
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint32_t n = triangle.corners[i];
      before[i] = to_point(mesh_.positions[left_[n]]);
      is_moved = is_moved || way_[n] != Point{0, 0, 0};
    }
    return is_moved && turns(before, places(triangle));
  }

  const Mesh& mesh_;
  const Context& context_;
  const double most_mm_;
  std::vector<WallSides> walls_;        // ascending
  std::vector<std::uint32_t> wall_of_;  // of each triangle of the mesh; empty: all are of one
  std::vector<double> lost_;            // of each wall: volume that no vertex owes
  std::vector<std::uint32_t> kept_;     // of each vertex of the mesh: what it has become
  std::vector<std::uint32_t> number_;   // of it among those that are left
  std::vector<std::uint32_t> left_;     // vertices of the mesh
  std::vector<LeftTriangle> triangles_;
  // In each round, a third of the area with its normal, and then the volume swept by each corner.
  std::vector<std::array<double, 3>> of_triangles_;
  std::vector<std::uint32_t> first_slot_;  // of each vertex that is left, and the end
  std::vector<Slot> slots_;
  std::vector<std::uint8_t> is_fixed_;
  std::vector<Cap> caps_;
  std::vector<double> limits_;  // millimetres
  std::vector<Point> way_;      // from its own place
};

}  // namespace

std::vector<Vec3> places_with_volume(const Mesh& mesh, std::span<const WallSides> sides,
                                     const History& history, double most_mm,
                                     const Context& context) {
  return Mover(mesh, sides, history, most_mm, context).run();
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
