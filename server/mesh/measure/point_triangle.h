// Distance from a point to a triangle, and the cubes that a triangle reaches; private to the
// kernels.
#pragma once

#include <array>
#include <cstddef>

#include "server/mesh/measure/surface_view.h"
#include "server/mesh/points.h"

namespace isomesh::mesh {

using Corners = std::array<Point, 3>;

inline Corners corners_of(const SurfaceView& surface, std::size_t triangle) {
  const auto& [a, b, c] = surface.triangles[triangle];
  return {to_point(surface.positions[a]), to_point(surface.positions[b]),
          to_point(surface.positions[c])};
}

// The triangle may be a line or a point. Computed in double precision as the distance to a point of
// the triangle, so it is never too small but for rounding.
double squared_distance(const Point& point, const Corners& triangle);

// Tests by separating axes whether a triangle may reach into a cube that meets its bounds (T.
// Akenine-Möller, "Fast 3D triangle-box overlap testing", Journal of Graphics Tools 6(1), 2001).
class TriangleReach {
 public:
  explicit TriangleReach(const Corners& corners);

  // Tests the triangle's plane.
  bool plane_meets(const Point& centre, double half_side) const;
  bool meets(const Point& centre, double half_side) const;

  // The cubes it may reach into, of those that this one becomes when it moves along x: the least
  // and the largest way, which may be infinite. The least is larger if there are none.
  std::array<double, 2> ways_along_x(const Point& centre, double half_side) const;

 private:
  Corners seen_from(const Point& centre) const;
  // Tests the triangle's shadow along an axis; the corners as seen from the cube's centre.
  bool shadow_meets(std::size_t axis, const Corners& from, double half_side) const;

  const Corners corners_;
  std::array<Point, 3> edges_;
  Point normal_;
};

}  // namespace isomesh::mesh
