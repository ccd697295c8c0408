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
  std::vector<std::uint32_t> origins;
  std::vector<bool> taken(mesh.positions.size());
  std::multimap<float, std::uint32_t> by_x;
  for (std::uint32_t v = 0; v < mesh.positions.size(); ++v) by_x.emplace(mesh.positions[v][0], v);
  for (const Place& point : decoded.points) {
    const auto x = static_cast<float>(tolerance);
    const auto is_near = [&](const auto& candidate) {
      const mesh::Vec3& position = mesh.positions[candidate.second];
      return !taken[candidate.second] && std::abs(position[1] - point[1]) <= tolerance &&
             std::abs(position[2] - point[2]) <= tolerance;
    };
    const auto end = by_x.upper_bound(point[0] + x);
    const auto found = std::find_if(by_x.lower_bound(point[0] - x), end, is_near);
    if (found == end) throw std::runtime_error("a decoded vertex is none of the mesh's");
    taken[found->second] = true;
    origins.push_back(found->second);
  }
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
