#include "server/mesh/measure/exact_triangles.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "server/mesh/measure/expansion.h"
#include "server/mesh/points.h"

namespace isomesh::mesh {
namespace {

// Half a unit in the last place of 1, as in Shewchuk's paper.
constexpr double kEpsilon = std::numeric_limits<double>::epsilon() / 2;

using Vertices = std::array<Vec3, 3>;
using Axes = std::array<std::size_t, 2>;
constexpr std::array<Axes, 3> kPlanes = {Axes{1, 2}, Axes{2, 0}, Axes{0, 1}};

Vertices vertices_of(std::span<const Vec3> positions, const Triangle& t) {
  return {positions[t[0]], positions[t[1]], positions[t[2]]};
}

int sign_of(double value) { return value > 0 ? 1 : value < 0 ? -1 : 0; }

Expansion exact_minus(const Vec3& a, const Vec3& b, std::size_t axis) {
  return Expansion::difference(double{a[axis]}, double{b[axis]});
}

// Twice the area of a triangle that is projected along an axis, in the plane of the others.
Expansion exact_area(const Vertices& t, const Axes& plane) {
  const auto [x, y] = plane;
  Expansion area = exact_minus(t[1], t[0], x) * exact_minus(t[2], t[0], y);
  area -= exact_minus(t[1], t[0], y) * exact_minus(t[2], t[0], x);
  return area;
}

// Its sign: 1 if the corners are counter-clockwise, 0 if they are on one line.
int turn_of(const Vertices& t, const Axes& plane) {
  const auto [x, y] = plane;
  const double left = (double{t[1][x]} - t[0][x]) * (double{t[2][y]} - t[0][y]);
  const double right = (double{t[1][y]} - t[0][y]) * (double{t[2][x]} - t[0][x]);
  const double bound = (3 + 16 * kEpsilon) * kEpsilon * (std::abs(left) + std::abs(right));
  const double area = left - right;
  return std::abs(area) > bound ? sign_of(area) : exact_area(t, plane).sign();
}

// On which side of a triangle's plane a point is: 1 where the normal points to, 0 on the plane.
class Plane {
 public:
  explicit Plane(const Vertices& corners) : corners_(corners) {
    const Point u = minus(to_point(corners[1]), to_point(corners[0]));
    const Point v = minus(to_point(corners[2]), to_point(corners[0]));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto [x, y] = kPlanes[axis];
      normal_[axis] = u[x] * v[y] - u[y] * v[x];
      terms_[axis] = std::abs(u[x] * v[y]) + std::abs(u[y] * v[x]);
    }
  }

  int side_of(const Vec3& point) const {
    const Point to = minus(to_point(point), to_point(corners_[0]));
    const double height = dot(normal_, to);
    const double sum =
        terms_[0] * std::abs(to[0]) + terms_[1] * std::abs(to[1]) + terms_[2] * std::abs(to[2]);
    const double bound = (7 + 56 * kEpsilon) * kEpsilon * sum;
    return std::abs(height) > bound ? sign_of(height) : exact_side_of(point);
  }

  std::array<int, 3> sides_of(const Vertices& points) const {
    return {side_of(points[0]), side_of(points[1]), side_of(points[2])};
  }

 private:
  int exact_side_of(const Vec3& point) const {
    Expansion height;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      height += exact_area(corners_, kPlanes[axis]) * exact_minus(point, corners_[0], axis);
    }
    return height.sign();
  }

  Vertices corners_;
  Point normal_ = {};
  Point terms_ = {};  // the magnitudes of what each component of the normal is the difference of
};

// A plane of two axes in which the triangle has an area; any if it is flat.
Axes plane_for(const Vertices& t) {
  const auto* const found =
      std::ranges::find_if(kPlanes, [&](const Axes& plane) { return turn_of(t, plane) != 0; });
  return found == kPlanes.end() ? kPlanes[0] : *found;
}

struct Segment {
  Vec3 from;
  Vec3 to;
};

// Both with their ends, in one plane.
bool cross_in_plane(const Segment& a, const Segment& b, const Axes& plane) {
  const int a_from = turn_of({b.from, b.to, a.from}, plane);
  const int a_to = turn_of({b.from, b.to, a.to}, plane);
  const int b_from = turn_of({a.from, a.to, b.from}, plane);
  const int b_to = turn_of({a.from, a.to, b.to}, plane);
  if (a_from != 0 || a_to != 0 || b_from != 0 || b_to != 0) {
    return a_from * a_to <= 0 && b_from * b_to <= 0;
  }
  return std::ranges::all_of(plane, [&](std::size_t axis) {  // on one line
    const auto [a_low, a_high] = std::minmax(a.from[axis], a.to[axis]);
    const auto [b_low, b_high] = std::minmax(b.from[axis], b.to[axis]);
    return a_low <= b_high && b_low <= a_high;
  });
}

bool have_one_sign(const std::array<int, 3>& signs) {
  const auto [least, most] = std::ranges::minmax(signs);
  return least * most >= 0;
}

bool meet_in_plane(const Segment& segment, const Vertices& t, const Axes& plane) {
  std::array<int, 3> turns;
  for (std::size_t i = 0; i < 3; ++i) {
    const Segment edge = {t[i], t[(i + 1) % 3]};
    if (cross_in_plane(segment, edge, plane)) return true;
    turns[i] = turn_of({edge.from, edge.to, segment.from}, plane);
  }
  return have_one_sign(turns);  // within
}

// A segment whose ends are on those sides of the triangle's plane.
bool meet(const Segment& segment, int from_side, int to_side, const Vertices& t) {
  if (from_side * to_side > 0) return false;
  if (from_side == 0 && to_side == 0) return meet_in_plane(segment, t, plane_for(t));
  std::array<int, 3> sides;
  for (std::size_t i = 0; i < 3; ++i) {
    sides[i] = Plane({segment.from, t[i], t[(i + 1) % 3]}).side_of(segment.to);
  }
  return have_one_sign(sides);
}

bool any_edge_meets(const Vertices& edges, const std::array<int, 3>& sides, const Vertices& t) {
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t next = (i + 1) % 3;
    if (meet({edges[i], edges[next]}, sides[i], sides[next], t)) return true;
  }
  return false;
}

bool are_apart(const std::array<int, 3>& sides) {
  return sides[0] != 0 && sides[0] == sides[1] && sides[0] == sides[2];
}

bool meet_anywhere(const Vertices& a, const Vertices& b) {
  const std::array<int, 3> sides_of_b = Plane(a).sides_of(b);
  if (are_apart(sides_of_b)) return false;
  const std::array<int, 3> sides_of_a = Plane(b).sides_of(a);
  if (are_apart(sides_of_a)) return false;
  return any_edge_meets(a, sides_of_a, b) || any_edge_meets(b, sides_of_b, a);
}

// Two triangles share one vertex, the first of each. If they meet elsewhere, it is in a segment
// from that vertex to the far side of one of them, or they touch at a far side. So they do not
// where a far side is on one side of the other's plane.
bool meet_beyond_vertex(const Vertices& a, const Vertices& b) {
  const auto sides_of_far = [](const Vertices& of, const Vertices& t) {
    const Plane plane(t);
    return std::array{plane.side_of(of[1]), plane.side_of(of[2])};
  };
  const auto [b1, b2] = sides_of_far(b, a);
  if (b1 * b2 > 0) return false;
  const auto [a1, a2] = sides_of_far(a, b);
  if (a1 * a2 > 0) return false;
  return meet({b[1], b[2]}, b1, b2, a) || meet({a[1], a[2]}, a1, a2, b);
}

// Along a common edge, their first two corners, two triangles meet nowhere else, unless one lies
// upon the other.
bool overlap_at_edge(const Vertices& a, const Vertices& b) {
  if (Plane(a).side_of(b[2]) != 0) return false;
  const Axes plane = plane_for(a);
  return turn_of(a, plane) == turn_of({a[0], a[1], b[2]}, plane);
}

// Orders the corners with the shared vertices first; the triangle as a set stays the same.
Triangle shared_first(const Triangle& triangle, const Triangle& other) {
  Triangle result = triangle;
  // The range that std::ranges' version returns does not compile with clang++ 14 and g++ 12's
  // library.
  std::stable_partition(result.begin(), result.end(), [&](std::uint32_t vertex) {
    return std::ranges::find(other, vertex) != other.end();
  });
  return result;
}

}  // namespace

bool is_flat(std::span<const Vec3> positions, const Triangle& triangle) {
  const Vertices corners = vertices_of(positions, triangle);
  return std::ranges::all_of(kPlanes,
                             [&](const Axes& plane) { return turn_of(corners, plane) == 0; });
}

bool do_intersect(std::span<const Vec3> positions, const Triangle& a, const Triangle& b) {
  const auto shared = std::ranges::count_if(
      a, [&](std::uint32_t vertex) { return std::ranges::find(b, vertex) != b.end(); });
  if (shared == 3) return true;
  if (shared == 0) return meet_anywhere(vertices_of(positions, a), vertices_of(positions, b));
  const Triangle first = shared_first(a, b);
  Triangle second = shared_first(b, a);
  if (shared == 1) {
    return meet_beyond_vertex(vertices_of(positions, first), vertices_of(positions, second));
  }
  if (second[0] != first[0]) std::swap(second[0], second[1]);
  return overlap_at_edge(vertices_of(positions, first), vertices_of(positions, second));
}

}  // namespace isomesh::mesh
