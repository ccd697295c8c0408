#include "server/mesh/measure/point_triangle.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace isomesh::mesh {
namespace {

// The least squared sine between two edges at which their normal has a direction.
constexpr double kLeastShape = 1e-20;

double squared(const Point& p) { return dot(p, p); }

// From the origin to the segment between two points, which may be equal.
double to_segment(const Point& a, const Point& b) {
  const Point ab = minus(b, a);
  const double length = squared(ab);
  const double share = length > 0 ? std::clamp(-dot(a, ab) / length, 0.0, 1.0) : 0;
  return squared({a[0] + share * ab[0], a[1] + share * ab[1], a[2] + share * ab[2]});
}

}  // namespace

double squared_distance(const Point& point, const Corners& triangle) {
  const Point a = minus(triangle[0], point);
  const Point b = minus(triangle[1], point);
  const Point c = minus(triangle[2], point);
  const Point ab = minus(triangle[1], triangle[0]);
  const Point ac = minus(triangle[2], triangle[0]);
  // The regions of the plane by the nearest corner, edge or side: C. Ericson, "Real-Time Collision
  // Detection", 2005, 5.1.5.
  const double d1 = -dot(ab, a);
  const double d2 = -dot(ac, a);
  if (d1 <= 0 && d2 <= 0) return squared(a);
  const double d3 = -dot(ab, b);
  const double d4 = -dot(ac, b);
  if (d3 >= 0 && d4 <= d3) return squared(b);
  const double d5 = -dot(ab, c);
  const double d6 = -dot(ac, c);
  if (d6 >= 0 && d5 <= d6) return squared(c);
  const double va = d3 * d6 - d5 * d4;
  const double vb = d5 * d2 - d1 * d6;
  const double vc = d1 * d4 - d3 * d2;
  if (va > 0 && vb > 0 && vc > 0) {
    const Point normal = cross(ab, ac);
    const double height = dot(normal, a);
    const double length = squared(normal);
    if (length > kLeastShape * squared(ab) * squared(ac)) return height * height / length;
  }
  if (vc <= 0 && d1 > 0 && d3 < 0) return to_segment(a, b);
  if (vb <= 0 && d2 > 0 && d6 < 0) return to_segment(a, c);
  if (va <= 0 && d4 > d3 && d5 > d6) return to_segment(b, c);
  // For a triangle that is almost a line, the regions do not tell the nearest edge.
  return std::min({to_segment(a, b), to_segment(a, c), to_segment(b, c)});
}

TriangleReach::TriangleReach(const Corners& corners)
    : corners_(corners), normal_(normal_of(corners[0], corners[1], corners[2])) {
  for (std::size_t i = 0; i < 3; ++i) edges_[i] = minus(corners[(i + 1) % 3], corners[i]);
}

bool TriangleReach::plane_meets(const Point& centre, double half_side) const {
  const double reach =
      half_side * (std::abs(normal_[0]) + std::abs(normal_[1]) + std::abs(normal_[2]));
  return std::abs(dot(normal_, minus(centre, corners_[0]))) <= reach;
}

bool TriangleReach::meets(const Point& centre, double half_side) const {
  if (!plane_meets(centre, half_side)) return false;
  const Corners from = seen_from(centre);
  return shadow_meets(0, from, half_side) && shadow_meets(1, from, half_side) &&
         shadow_meets(2, from, half_side);
}

Corners TriangleReach::seen_from(const Point& centre) const {
  return {minus(corners_[0], centre), minus(corners_[1], centre), minus(corners_[2], centre)};
}

bool TriangleReach::shadow_meets(std::size_t axis, const Corners& from, double half_side) const {
  const std::size_t u = (axis + 1) % 3;
  const std::size_t v = (axis + 2) % 3;
  return std::ranges::all_of(edges_, [&](const Point& edge) {
    const double reach = half_side * (std::abs(edge[u]) + std::abs(edge[v]));
    const auto along = [&](const Point& p) { return edge[u] * p[v] - edge[v] * p[u]; };
    const auto [low, high] = std::minmax({along(from[0]), along(from[1]), along(from[2])});
    return low <= reach && high >= -reach;
  });
}

std::array<double, 2> TriangleReach::ways_along_x(const Point& centre, double half_side) const {
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  constexpr std::array kNone = {kInfinite, -kInfinite};
  if (!shadow_meets(0, seen_from(centre), half_side)) return kNone;
  const double reach =
      half_side * (std::abs(normal_[0]) + std::abs(normal_[1]) + std::abs(normal_[2]));
  const double off = dot(normal_, minus(centre, corners_[0]));
  if (normal_[0] == 0) return std::abs(off) <= reach ? std::array{-kInfinite, kInfinite} : kNone;
  const auto [least, largest] =
      std::minmax({(-reach - off) / normal_[0], (reach - off) / normal_[0]});
  return {least, largest};
}

}  // namespace isomesh::mesh
