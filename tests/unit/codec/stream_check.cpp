#include "tests/unit/codec/stream_check.h"

#include <algorithm>
#include <array>
#include <stdexcept>
#include <vector>

#include "server/codec/draco/grid.h"
#include "tests/unit/codec/decode.h"
#include "tests/unit/codec/placed.h"

namespace isomesh::test {
namespace {

std::size_t named_vertices(const mesh::Mesh& mesh) {
  std::vector<bool> named(mesh.positions.size());
  for (const mesh::Triangle& triangle : mesh.triangles) {
    for (const std::uint32_t vertex : triangle) named[vertex] = true;
  }
  return static_cast<std::size_t>(std::ranges::count(named, true));
}

}  // namespace

std::string difference(const DecodedMesh& decoded, const mesh::Mesh& mesh, int position_bits,
                       MaySplit may_split) {
  if (decoded.triangles.size() != mesh.triangles.size()) {
    return std::to_string(decoded.triangles.size()) + " triangles instead of " +
           std::to_string(mesh.triangles.size());
  }
  const std::size_t named = named_vertices(mesh);
  const bool enough =
      may_split == MaySplit::kYes ? decoded.points.size() >= named : decoded.points.size() == named;
  if (!enough) {
    return std::to_string(decoded.points.size()) + " points instead of " + std::to_string(named);
  }
  const codec::Grid grid = codec::grid_of(mesh, position_bits);
  std::vector<std::array<float, 3>> expected;
  for (const mesh::Vec3& position : mesh.positions) {
    auto& point = expected.emplace_back();
    for (std::size_t axis = 0; axis < 3; ++axis) point[axis] = grid.decoded(position[axis], axis);
  }
  if (placed(decoded.points, decoded.triangles) != placed(expected, mesh.triangles)) {
    return "other triangles";
  }
  return "";
}

std::string difference(std::string_view drc, const mesh::Mesh& mesh, int position_bits,
                       MaySplit may_split) {
  try {
    return difference(decode_in_process(drc), mesh, position_bits, may_split);
  } catch (const std::runtime_error& refusal) {
    return refusal.what();
  }
}

}  // namespace isomesh::test
