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

Grid grid_of(const mesh::Reach& box, int bits) {
  Grid grid = {.low = {}, .side = 0, .bits = bits};
  if (box.is_empty()) return grid;
  float longest = least_range(bits);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    longest = std::max(longest, box.high[axis] - box.low[axis]);
  }
  if (has_decimals(longest, bits)) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      grid.low[axis] = to_decimals(box.low[axis]);
      // The last decimal more: rounding could put the highest vertex outside.
      grid.side = std::max(grid.side, to_decimals(box.high[axis] - grid.low[axis] + kDecimal));
    }
  } else {
    grid.low = box.low;
    grid.side = longest;
  }
  if (!std::isfinite(grid.side)) {
    throw Error(ErrorCode::kUnusableVolume, "The surface has coordinates that are not finite.");
  }
  return grid;
}

mesh::Reach box_of(std::span<const mesh::Vec3> positions) {
  mesh::Reach box;
  float zero = 0;  // becomes NaN if multiplied by a non-finite value
  for (const mesh::Vec3& position : positions) {
    box.add({position, position});
    for (const float coordinate : position) zero += 0 * coordinate;
  }
  if (zero != 0) {
    const float far = mesh::Reach::kFar;
    box = {{-far, -far, -far}, {far, far, far}};
  }
  return box;
}

bool is_grid_of(const mesh::Reach& reach, const mesh::Reach& box) {
  float longest = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    longest = std::max(longest, std::abs(reach.high[axis] - reach.low[axis]));
  }
  return !box.is_empty() && std::isfinite(longest) && reach.holds(box);
}

Grid grid_of(const mesh::Mesh& mesh, int bits) {
  const mesh::Reach box = box_of(mesh.positions.span());
  return grid_of(is_grid_of(mesh.reach, box) ? mesh.reach : box, bits);
}

}  // namespace isomesh::codec
