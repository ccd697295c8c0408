#include "server/mesh/lattice/lattice.h"

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

std::array<double, 3> index_of(const LatticeToSpace& to_space, const std::array<double, 3>& point) {
  const Point from = minus(point, to_space.origin);
  const auto& [a, b, c] = std::array{to_space.step_x, to_space.step_y, to_space.step_z};
  const double scale = to_space.determinant();
  return {dot(cross(b, c), from) / scale, dot(cross(c, a), from) / scale,
          dot(cross(a, b), from) / scale};
}

}  // namespace isomesh::mesh
