#include "server/mesh/lattice/placement.h"

#include <array>
#include <cmath>
#include <limits>

#include "server/mesh/points.h"

namespace isomesh::mesh {
namespace {

using Offset = std::array<double, 3>;

double largest_coordinate(const Dims& dims, const LatticeToSpace& to_space) {
  double largest = 0;
  for (unsigned corner = 0; corner < 8; ++corner) {
    const double x = (corner & 1) != 0 ? dims.x - 1.0 : 0;
    const double y = (corner & 2) != 0 ? dims.y - 1.0 : 0;
    const double z = (corner & 4) != 0 ? dims.z - 1.0 : 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      largest = std::max(largest, std::abs(to_space.origin[axis] + to_space.step_x[axis] * x +
                                           to_space.step_y[axis] * y + to_space.step_z[axis] * z));
    }
  }
  return largest;
}

bool is_axis_aligned(const LatticeToSpace& to_space) {
  const auto along_one_axis = [](const Offset& step) { return std::ranges::count(step, 0.0) == 2; };
  return along_one_axis(to_space.step_x) && along_one_axis(to_space.step_y) &&
         along_one_axis(to_space.step_z);
}

// The smallest distance between neighbouring planes of samples.
double plane_distance(const LatticeToSpace& to_space) {
  const auto area = [](const Offset& a, const Offset& b) {
    const Offset normal = cross(a, b);
    return std::hypot(normal[0], normal[1], normal[2]);
  };
  const double volume = std::abs(to_space.determinant());
  return std::min({volume / area(to_space.step_y, to_space.step_z),
                   volume / area(to_space.step_z, to_space.step_x),
                   volume / area(to_space.step_x, to_space.step_y)});
}

}  // namespace

double Placement::nearest_share(const Dims& dims, const LatticeToSpace& to_space) {
  // Along a coordinate axis, one unit in the last place survives any rounding. Oblique steps change
  // each coordinate by a part of it, and need four.
  const double units = is_axis_aligned(to_space) ? 1 : 4;
  const double resolved =
      largest_coordinate(dims, to_space) * std::numeric_limits<float>::epsilon();
  const double distance = plane_distance(to_space);
  constexpr double kMost = 0.25;
  return distance > 0 ? std::min(units * resolved / distance, kMost) : kMost;
}

}  // namespace isomesh::mesh
