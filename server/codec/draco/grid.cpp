#include "server/codec/draco/grid.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "proto/error.h"

namespace isomesh::codec {
namespace {

// libdraco keeps its options as text with six decimals, and quantises with the value read back from
// it. Our encoder uses the same value.
constexpr float kOptionStep = 1e-6F;

float as_draco_keeps(float value) { return std::stof(std::to_string(value)); }

}  // namespace

float Grid::decoded(float coordinate, std::size_t axis) const {
  const auto steps = static_cast<float>((1 << bits) - 1);
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
  for (std::size_t axis = 0; axis < 3; ++axis) {
    grid.low[axis] = as_draco_keeps(low[axis]);
    // Add one step: rounding could put the highest vertex outside.
    grid.side = std::max(grid.side, as_draco_keeps(high[axis] - grid.low[axis] + kOptionStep));
  }
  if (zero != 0 || !std::isfinite(grid.side)) {
    throw Error(ErrorCode::kUnusableVolume, "The surface has coordinates that are not finite.");
  }
  return grid;
}

}  // namespace isomesh::codec
