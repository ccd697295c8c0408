// Arithmetic on points.
#pragma once

#include <array>
#include <cmath>

#include "server/mesh/mesh.h"

namespace isomesh::mesh {

using Point = std::array<double, 3>;  // millimetres

inline Point to_point(const Vec3& v) { return {double{v[0]}, double{v[1]}, double{v[2]}}; }

template <class T>
std::array<T, 3> plus(const std::array<T, 3>& a, const std::array<T, 3>& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}

template <class T>
std::array<T, 3> minus(const std::array<T, 3>& a, const std::array<T, 3>& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

template <class T>
T dot(const std::array<T, 3>& a, const std::array<T, 3>& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

template <class T>
std::array<T, 3> cross(const std::array<T, 3>& a, const std::array<T, 3>& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

// The normal of a triangle; its length is twice the area. Exact up to one rounding if the corners
// are near each other.
template <class T>
std::array<T, 3> normal_of(const std::array<T, 3>& a, const std::array<T, 3>& b,
                           const std::array<T, 3>& c) {
  return cross(minus(b, a), minus(c, a));
}

}  // namespace isomesh::mesh
