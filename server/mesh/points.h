// Arithmetic on points in double precision; private to this folder.
#pragma once

#include <array>
#include <cmath>

#include "server/mesh/mesh.h"

namespace isomesh::mesh {

using Point = std::array<double, 3>;  // millimetres

inline Point to_point(const Vec3& v) { return {double{v[0]}, double{v[1]}, double{v[2]}}; }

inline Point minus(const Point& a, const Point& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

inline double dot(const Point& a, const Point& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

inline Point cross(const Point& a, const Point& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

// The normal of a triangle; its length is twice the area. Exact up to one rounding if the corners
// are near each other.
inline Point normal_of(const Point& a, const Point& b, const Point& c) {
  return cross(minus(b, a), minus(c, a));
}

}  // namespace isomesh::mesh
