// The cubes whose triangles are simplified together; private to this folder.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "proto/error.h"
#include "server/mesh/measure/measure.h"
#include "server/mesh/points.h"

namespace isomesh::mesh {

// Cuts space into cubes with about as many triangles of a surface each. Those of the odd rounds are
// moved by half a side along each axis.
class Cubes {
 public:
  // Throws Error kUnusableVolume where a position was not a finite number.
  Cubes(const Extent& extent, std::size_t triangles) : low_(extent.low) {
    if (!std::isfinite(extent.area_mm2)) {
      throw Error(ErrorCode::kUnusableVolume, "a position of the mesh is not a finite number");
    }
    const double area_per_triangle = extent.area_mm2 / static_cast<double>(triangles);
    side_ = std::sqrt(kTrianglesPerBlock * area_per_triangle);
    double longest = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      longest = std::max(longest, extent.high[axis] - extent.low[axis]);
    }
    side_ = std::max(side_, longest / kMostCubesPerAxis);
    if (!(side_ > 0)) side_ = 1;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      count_[axis] = static_cast<std::uint32_t>((extent.high[axis] - extent.low[axis]) / side_) + 2;
    }
  }

  std::uint32_t count() const { return count_[0] * count_[1] * count_[2]; }

  std::uint32_t at(const Point& point, int round) const {
    const double shift = round % 2 == 1 ? 0.5 : 0;
    std::uint32_t cube = 0;
    for (std::size_t axis = 3; axis-- > 0;) {
      const double place = (point[axis] - low_[axis]) / side_ + shift;
      const auto at = static_cast<std::uint32_t>(std::clamp(place, 0.0, count_[axis] - 1.0));
      cube = cube * count_[axis] + at;
    }
    return cube;
  }

  // True if the point is near a face between cubes of the previous round.
  bool is_near_seam(const Point& point, int round) const {
    const double shift = round % 2 == 1 ? 0 : 0.5;
    return std::ranges::any_of(std::array<std::size_t, 3>{0, 1, 2}, [&](std::size_t axis) {
      const double place = (point[axis] - low_[axis]) / side_ + shift;
      return std::abs(place - std::round(place)) < kSeamWidth;
    });
  }

 private:
  // Larger blocks have fewer seams, smaller ones stay in the cache and are sooner made again.
  static constexpr double kTrianglesPerBlock = 6'000;
  // How near to a seam counts as near, as a share of a cube's side.
  static constexpr double kSeamWidth = 0.08;
  static constexpr double kMostCubesPerAxis = 64;

  Point low_;
  double side_ = 1;
  std::array<std::uint32_t, 3> count_ = {1, 1, 1};
};

}  // namespace isomesh::mesh
