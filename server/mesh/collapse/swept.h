// The volume that moving triangles sweep, and arithmetic for it; private to this folder.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include "server/mesh/measure/point_triangle.h"
#include "server/mesh/points.h"

namespace isomesh::mesh::collapse {

inline Point scaled(const Point& p, double factor) {
  return {p[0] * factor, p[1] * factor, p[2] * factor};
}

inline double length(const Point& p) { return std::sqrt(dot(p, p)); }

inline Vec3 rounded(const Point& p) {
  return {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
}

inline Point third_of_area(const Corners& corners) {
  return scaled(normal_of(corners[0], corners[1], corners[2]), 1.0 / 6);
}

// The volume that a triangle sweeps on a straight way of its corners, in front of it. It is divided
// among the corners by their ways; the sum over a closed surface is the exact change of its volume.
// The integrand is quadratic, so Simpson's rule is exact.
inline std::array<double, 3> swept(const Corners& from, const Corners& to) {
  Corners middle;
  for (std::size_t i = 0; i < 3; ++i) middle[i] = scaled(plus(from[i], to[i]), 0.5);
  const Point ends = plus(normal_of(from[0], from[1], from[2]), normal_of(to[0], to[1], to[2]));
  const Point inner = normal_of(middle[0], middle[1], middle[2]);
  const Point area = scaled(plus(ends, scaled(inner, 4)), 1.0 / 36);
  return {dot(minus(to[0], from[0]), area), dot(minus(to[1], from[1]), area),
          dot(minus(to[2], from[2]), area)};
}

}  // namespace isomesh::mesh::collapse
