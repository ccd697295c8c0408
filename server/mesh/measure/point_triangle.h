// Distance from a point to a triangle, and the cubes that a triangle reaches; private to the
// kernels.
#pragma once

#include <array>

#include "server/mesh/points.h"

namespace isomesh::mesh {

using Corners = std::array<Point, 3>;

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

 private:
  const Corners corners_;
  std::array<Point, 3> edges_;
  Point normal_;
};

}  // namespace isomesh::mesh
