#include "tests/support/exact_distance.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace isomesh::test {
namespace {

using Point = std::array<double, 3>;
using Corners = std::array<Point, 3>;

Point minus(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
double dot(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Point cross(const Point& a, const Point& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Point along(const Point& a, const Point& way, double share) {
  return {a[0] + way[0] * share, a[1] + way[1] * share, a[2] + way[2] * share};
}

double to_segment(const Point& p, const Point& a, const Point& b) {
  const Point way = minus(b, a);
  const double squared = dot(way, way);
  const double share = squared > 0 ? std::clamp(dot(minus(p, a), way) / squared, 0.0, 1.0) : 0;
  const Point rest = minus(p, along(a, way, share));
  return std::sqrt(dot(rest, rest));
}

double to_triangle(const Point& p, const Corners& t) {
  double least =
      std::min({to_segment(p, t[0], t[1]), to_segment(p, t[1], t[2]), to_segment(p, t[2], t[0])});
  const Point normal = cross(minus(t[1], t[0]), minus(t[2], t[0]));
  if (!(dot(normal, normal) > 0)) return least;
  for (std::size_t i = 0; i < 3; ++i) {
    const Point edge = minus(t[(i + 1) % 3], t[i]);
    if (dot(cross(edge, minus(p, t[i])), normal) < 0) return least;  // the foot is outside
  }
  return std::min(least, std::abs(dot(normal, minus(p, t[0]))) / std::sqrt(dot(normal, normal)));
}

// True if all corners are farther than `reach` from `p` on the same side along one axis.
bool is_beyond(const Point& p, const Corners& t, double reach) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto [low, high] = std::minmax({t[0][axis], t[1][axis], t[2][axis]});
    if (low - p[axis] > reach || p[axis] - high > reach) return true;
  }
  return false;
}

double area(const Corners& t) {
  const Point normal = cross(minus(t[1], t[0]), minus(t[2], t[0]));
  return 0.5 * std::sqrt(dot(normal, normal));
}

}  // namespace

double distance_to(const Point& point, const TriangleSoup& soup) {
  double least = std::numeric_limits<double>::infinity();
  for (const Corners& triangle : soup.triangles) {
    if (!is_beyond(point, triangle, least)) least = std::min(least, to_triangle(point, triangle));
  }
  return least;
}

double largest_distance(const TriangleSoup& from, const TriangleSoup& to, std::size_t points,
                        std::uint32_t seed) {
  std::mt19937 random(seed);
  const auto share = [&] { return static_cast<double>(random()) / 4294967296.0; };
  double sum = 0;
  for (const Corners& triangle : from.triangles) sum += std::sqrt(area(triangle));
  double most = 0;
  for (const Corners& t : from.triangles) {
    std::vector<std::array<double, 2>> places = {{0, 0}, {1, 0}, {0, 1}, {1 / 3.0, 1 / 3.0}};
    const double wanted = static_cast<double>(points) * std::sqrt(area(t)) / sum + share();
    for (int i = 0; i < static_cast<int>(wanted); ++i) {
      const double u = share();
      const double v = share();
      places.push_back(u + v > 1 ? std::array{1 - u, 1 - v} : std::array{u, v});
    }
    for (const auto& [u, v] : places) {
      const Point p = along(along(t[0], minus(t[1], t[0]), u), minus(t[2], t[0]), v);
      most = std::max(most, distance_to(p, to));
    }
  }
  return most;
}

}  // namespace isomesh::test
