#include "server/mesh/lattice/lattice.h"

#include <algorithm>
#include <cmath>

#include "server/mesh/points.h"

namespace isomesh::mesh {

double LatticeToSpace::determinant() const { return dot(step_x, cross(step_y, step_z)); }

LatticeToSpace lattice_to_space(const Geometry& geometry) {
  const auto column = [&](std::size_t axis) {
    const double length = geometry.spacing[axis];
    return std::array{geometry.direction[axis] * length, geometry.direction[3 + axis] * length,
                      geometry.direction[6 + axis] * length};
  };
  return {geometry.origin, column(0), column(1), column(2)};
}

double unit_mm(const LatticeToSpace& to_space) {
  constexpr double kExponents = 16;
  const auto length = [](const Point& step) { return std::hypot(step[0], step[1], step[2]); };
  const double longest =
      std::max({length(to_space.step_x), length(to_space.step_y), length(to_space.step_z)});
  return std::exp2(kExponents * std::round(std::log2(longest) / kExponents));
}

std::array<double, 3> index_of(const LatticeToSpace& to_space, const std::array<double, 3>& point) {
  const Point from = minus(point, to_space.origin);
  const auto& [a, b, c] = std::array{to_space.step_x, to_space.step_y, to_space.step_z};
  const double scale = to_space.determinant();
  return {dot(cross(b, c), from) / scale, dot(cross(c, a), from) / scale,
          dot(cross(a, b), from) / scale};
}

}  // namespace isomesh::mesh
