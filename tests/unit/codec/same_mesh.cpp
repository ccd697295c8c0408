#include "tests/unit/codec/same_mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <stdexcept>

#include <gtest/gtest.h>

#include "tests/unit/codec/placed.h"

namespace isomesh::test {

Grid grid_of(const mesh::Mesh& mesh, int position_bits) {
  Grid grid;
  grid.low.fill(std::numeric_limits<double>::infinity());
  std::array<double, 3> high;
  high.fill(-std::numeric_limits<double>::infinity());
  double largest = 0;
  for (const mesh::Vec3& position : mesh.positions) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      grid.low[axis] = std::min<double>(grid.low[axis], position[axis]);
      high[axis] = std::max<double>(high[axis], position[axis]);
      largest = std::max<double>(largest, std::abs(position[axis]));
    }
  }
  if (!mesh.reach.is_empty()) {
    std::ranges::copy(mesh.reach.low, grid.low.begin());
    std::ranges::copy(mesh.reach.high, high.begin());
  }
  double side = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) side = std::max(side, high[axis] - grid.low[axis]);
  grid.step = side / (std::exp2(position_bits) - 1);
  grid.float_error = 4 * (largest + side) * std::numeric_limits<float>::epsilon();
  return grid;
}

namespace {

// Every decoded vertex is near one of the mesh and no two are near the same; its index there. The
// vertices of the meshes here are farther apart than the coarsest grid moves them.
std::vector<std::uint32_t> origins_of(const DecodedMesh& decoded, const mesh::Mesh& mesh,
                                      double tolerance) {
  // By cubes that are wide enough for what is near a point to be in its own or those around it.
  using Cube = std::array<std::int64_t, 3>;
  const double side = 2 * tolerance;
  const auto cube_at = [&](const auto& position) {
    Cube cube;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      cube[axis] = static_cast<std::int64_t>(std::floor(position[axis] / side));
    }
    return cube;
  };
  std::map<Cube, std::vector<std::uint32_t>> cubes;
  for (std::uint32_t v = 0; v < mesh.positions.size(); ++v) {
    cubes[cube_at(mesh.positions[v])].push_back(v);
  }
  const auto take_near = [&](const Place& point) {
    const Cube middle = cube_at(point);
    for (int n = 0; n < 27; ++n) {
      const auto cube =
          cubes.find({middle[0] + n % 3 - 1, middle[1] + n / 3 % 3 - 1, middle[2] + n / 9 - 1});
      if (cube == cubes.end()) continue;
      const auto is_near = [&](std::uint32_t v) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
          if (std::abs(mesh.positions[v][axis] - point[axis]) > tolerance) return false;
        }
        return true;
      };
      const auto found = std::ranges::find_if(cube->second, is_near);
      if (found == cube->second.end()) continue;
      const std::uint32_t vertex = *found;
      cube->second.erase(found);
      return vertex;
    }
    throw std::runtime_error("a decoded vertex is none of the mesh's");
  };
  std::vector<std::uint32_t> origins;
  for (const Place& point : decoded.points) origins.push_back(take_near(point));
  return origins;
}

// The mesh's own triangles with every vertex where its neighbour on the grid is.
std::vector<PlacedTriangle> on_grid(const DecodedMesh& decoded, const mesh::Mesh& mesh,
                                    const Grid& grid) {
  const double tolerance = grid.step / 2 + grid.float_error;
  const std::vector<std::uint32_t> origins = origins_of(decoded, mesh, tolerance);
  std::vector<Place> places(mesh.positions.size());
  for (std::size_t v = 0; v < origins.size(); ++v) places[origins[v]] = decoded.points[v];
  return placed(places, mesh.triangles);
}

}  // namespace

void expect_same_mesh(const DecodedMesh& decoded, const mesh::Mesh& mesh, int position_bits) {
  ASSERT_EQ(decoded.points.size(), mesh.positions.size());
  ASSERT_EQ(decoded.triangles.size(), mesh.triangles.size());
  const Grid grid = grid_of(mesh, position_bits);
  EXPECT_EQ(placed(decoded.points, decoded.triangles), on_grid(decoded, mesh, grid));
}

DecodedMesh welded(const std::vector<DecodedMesh>& parts) {
  DecodedMesh whole;
  std::map<std::array<float, 3>, std::uint32_t> numbers;
  for (const DecodedMesh& part : parts) {
    for (const auto& triangle : part.triangles) {
      auto& corners = whole.triangles.emplace_back();
      for (std::size_t corner = 0; corner < 3; ++corner) {
        const auto& point = part.points[triangle[corner]];
        const auto [found, is_new] =
            numbers.emplace(point, static_cast<std::uint32_t>(whole.points.size()));
        if (is_new) whole.points.push_back(point);
        corners[corner] = found->second;
      }
    }
  }
  return whole;
}

}  // namespace isomesh::test
