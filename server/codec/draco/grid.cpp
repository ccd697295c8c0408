#include "server/codec/draco/grid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "proto/error.h"

namespace isomesh::codec {
namespace {

constexpr float kDecimal = 1e-6F;

float steps_of(int bits) { return static_cast<float>((1 << bits) - 1); }

// Older grids had six decimals, because libdraco's setters keep no more. Where a step is not
// smaller, grids still have them, so that meshes keep their bytes.
bool has_decimals(float longest, int bits) { return longest >= steps_of(bits) * kDecimal; }

float to_decimals(float value) { return std::stof(std::to_string(value)); }

// A smaller step would be subnormal, and its inverse infinite.
float least_range(int bits) { return steps_of(bits) * std::numeric_limits<float>::min(); }

}  // namespace

float range_from_zero(float most, int bits) {
  if (most == 0) return 1;
  return has_decimals(most, bits) ? to_decimals(most) : std::max(most, least_range(bits));
}

float Grid::decoded(float coordinate, std::size_t axis) const {
  const float steps = steps_of(bits);
  const float scaled = (coordinate - low[axis]) * (steps / side);
  const auto quantised = static_cast<int>(std::floor(scaled + 0.5F));
  return static_cast<float>(quantised) * (side / steps) + low[axis];
}

Grid grid_of(const mesh::Mesh& mesh, int bits) {
  Grid grid = {.low = {}, .side = 0, .bits = bits};
  if (mesh.positions.size() == 0) return grid;
  mesh::Vec3 low = mesh.positions[0];
  mesh::Vec3 high = low;
  float zero = 0;  // becomes NaN if multiplied by a non-finite value
  for (const mesh::Vec3& position : mesh.positions) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], position[axis]);
      high[axis] = std::max(high[axis], position[axis]);
      zero += 0 * position[axis];
    }
  }
  float longest = least_range(bits);
  for (std::size_t axis = 0; axis < 3; ++axis) longest = std::max(longest, high[axis] - low[axis]);
  if (has_decimals(longest, bits)) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      grid.low[axis] = to_decimals(low[axis]);
      // The last decimal more: rounding could put the highest vertex outside.
      grid.side = std::max(grid.side, to_decimals(high[axis] - grid.low[axis] + kDecimal));
    }
  } else {
    grid.low = low;
    grid.side = longest;
  }
  if (zero != 0 || !std::isfinite(grid.side)) {
    throw Error(ErrorCode::kUnusableVolume, "The surface has coordinates that are not finite.");
  }
  return grid;
}

}  // namespace isomesh::codec
