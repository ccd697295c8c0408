// Points, triangles and surfaces of isomesh-verify, which shares none with what makes surfaces.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace isomesh::verify {

using Vec = std::array<double, 3>;  // in millimetres, LPS, unless a name says otherwise

inline Vec operator+(const Vec& a, const Vec& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
inline Vec operator-(const Vec& a, const Vec& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
inline Vec operator*(double s, const Vec& a) { return {s * a[0], s * a[1], s * a[2]}; }
inline double dot(const Vec& a, const Vec& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
inline Vec cross(const Vec& a, const Vec& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline double squared(const Vec& a) { return dot(a, a); }
inline double length(const Vec& a) { return std::sqrt(squared(a)); }

using Corners = std::array<Vec, 3>;

// Twice the area, along the side from which the corners run counter-clockwise.
inline Vec normal_of(const Corners& t) { return cross(t[1] - t[0], t[2] - t[0]); }
inline Vec centre_of(const Corners& t) { return (1.0 / 3) * (t[0] + t[1] + t[2]); }

struct Surface {
  std::vector<Vec> points;
  std::vector<std::array<std::uint32_t, 3>> triangles;  // indices of points

  Corners corners(std::size_t triangle) const {
    const auto& [a, b, c] = triangles[triangle];
    return {points[a], points[b], points[c]};
  }
};

// For each point the smallest point of its connected component. Points without triangles are
// components of their own.
std::vector<std::uint32_t> components_of(const Surface& surface);

}  // namespace isomesh::verify
