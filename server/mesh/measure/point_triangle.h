// How far a point is from a triangle, and which cubes a triangle reaches; private to this folder.
#pragma once

#include <array>

#include "server/mesh/points.h"

namespace isomesh::mesh {

using Corners = std::array<Point, 3>;

// The triangle may be a line or a point. In double precision, as the distance to a point of the
// triangle: never less than it is, but for rounding.
double squared_distance(const Point& point, const Corners& triangle);

// Whether a triangle may reach into cubes whose faces do not part the two: by separating axes (T.
// Akenine-Möller, "Fast 3D triangle-box overlap testing", Journal of Graphics Tools 6(1), 2001).
class TriangleReach {
 public:
  explicit TriangleReach(const Corners& corners);

  // Whether its plane does.
  bool plane_meets(const Point& centre, double half_side) const;
  bool meets(const Point& centre, double half_side) const;

 private:
  const Corners corners_;
  std::array<Point, 3> edges_;
  Point normal_;
};

}  // namespace isomesh::mesh
