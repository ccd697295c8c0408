// Points, triangles and surfaces of isomesh-verify, which shares none with what makes surfaces.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
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

using Indices = std::array<std::uint32_t, 3>;
using Corners = std::array<Vec, 3>;

// Twice the area, along the side from which the corners run counter-clockwise.
inline Vec normal_of(const Corners& t) { return cross(t[1] - t[0], t[2] - t[0]); }
inline Vec centre_of(const Corners& t) { return (1.0 / 3) * (t[0] + t[1] + t[2]); }

struct Surface {
  std::vector<Vec> points;
  std::vector<Indices> triangles;

  Corners corners(std::size_t triangle) const {
    const auto& [a, b, c] = triangles[triangle];
    return {points[a], points[b], points[c]};
  }
};

// For each point the lowest point of its connected component.
std::vector<std::uint32_t> components_of(const Surface& surface);

// The square of the distance if that is at most `enough`; else any number above that. Triangles
// without an area are segments or points.
double squared_distance(const Vec& point, const Corners& triangle, double enough);

struct Nearest {
  double squared = std::numeric_limits<double>::infinity();
  std::uint32_t triangle = 0;
};

// A tree of boxes around a surface's triangles. Immutable, so safe to use from several threads.
class Tree {
 public:
  // Puts the triangles into another order, which must stay: those of a box are neighbours.
  explicit Tree(Surface& surface);

  // The nearest triangle to a point, or `hint` if none is nearer. Infinitely far if there is none.
  Nearest nearest(const Vec& point, std::uint32_t hint) const;

  // True if a triangle within that distance of the point faces the same side as the normal.
  bool has_near(const Vec& point, double distance, const Vec& normal) const;

  const Surface& surface() const { return surface_; }

 private:
  static constexpr double kFar = std::numeric_limits<double>::infinity();

  struct Node {
    std::uint32_t first = 0;  // of a leaf: its first triangle; else the second child
    std::uint32_t count = 0;  // triangles of a leaf; else 0, and the first child is the next node
    Vec low = {kFar, kFar, kFar};
    Vec high = {-kFar, -kFar, -kFar};
  };
  struct Item {
    Vec centre;
    Indices triangle;
  };

  void build(std::vector<Item>& items, std::uint32_t begin, std::uint32_t end);
  // The nearest of the triangles that `takes`, or `best` if none is nearer.
  template <class Takes>
  Nearest nearest_of(const Vec& point, Nearest best, const Takes& takes) const;

  const Surface& surface_;
  std::vector<Node> nodes_;
};

}  // namespace isomesh::verify
