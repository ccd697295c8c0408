// What is encoded is decoded by libdraco and by Debian's draco_decoder, which must be installed.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include "server/codec/encode.h"
#include "tests/support/draco_decoder.h"
#include "tests/support/errors.h"
#include "tests/unit/codec/decode.h"
#include "tests/unit/codec/meshes.h"

namespace isomesh::codec {
namespace {

using test::decode_in_process;
using test::DecodedMesh;
using test::encoded;

// The grid that the header promises: it starts at the mesh's lowest corner and its cube's side is
// the mesh's longest extent.
struct Grid {
  std::array<double, 3> low = {};
  double step = 0;
  double float_error = 0;  // what single precision costs, which counts from 20 bits on
};

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

// A triangle by where its corners lie, from the smallest one on in its own sense of rotation.
using Place = std::array<float, 3>;
using PlacedTriangle = std::array<Place, 3>;

template <class Points, class Triangles>
std::vector<PlacedTriangle> placed(const Points& points, const Triangles& triangles) {
  std::vector<PlacedTriangle> result;
  for (const auto& [a, b, c] : triangles) {
    PlacedTriangle corners = {points[a], points[b], points[c]};
    std::ranges::rotate(corners, std::ranges::min_element(corners));
    result.push_back(corners);
  }
  std::ranges::sort(result);
  return result;
}

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

// Every vertex is held against its own place and every triangle against its own corners.
void expect_same_mesh(const DecodedMesh& decoded, const mesh::Mesh& mesh, int position_bits) {
  ASSERT_EQ(decoded.points.size(), mesh.positions.size());
  ASSERT_EQ(decoded.triangles.size(), mesh.triangles.size());
  const Grid grid = grid_of(mesh, position_bits);
  EXPECT_EQ(placed(decoded.points, decoded.triangles), on_grid(decoded, mesh, grid));
}

class Drc : public testing::TestWithParam<DracoParameters> {};

TEST_P(Drc, DecodesInProcessToTheSameMesh) {
  for (const auto& [name, mesh] : test::meshes_to_encode()) {
    SCOPED_TRACE(name);
    const DecodedMesh decoded = decode_in_process(encoded(mesh, MeshFormat::kDrc, GetParam()));
    expect_same_mesh(decoded, mesh, GetParam().position_bits);
  }
}

TEST_P(Drc, DecodesByDebiansCommandAsInProcess) {
  for (const auto& [name, mesh] : test::meshes_to_encode()) {
    SCOPED_TRACE(name);
    const std::string drc = encoded(mesh, MeshFormat::kDrc, GetParam());
    const DecodedMesh expected = decode_in_process(drc);
    const DecodedMesh decoded = test::decode_with_command(drc);
    EXPECT_EQ(decoded.points, expected.points);
    EXPECT_EQ(decoded.triangles, expected.triangles);
  }
}

INSTANTIATE_TEST_SUITE_P(Parameters, Drc,
                         testing::Values(DracoParameters{8, 7}, DracoParameters{11, 5},
                                         DracoParameters{14, 7}, DracoParameters{16, 0},
                                         DracoParameters{18, 3}, DracoParameters{20, 7},
                                         DracoParameters{22, 10}, DracoParameters{24, 5}),
                         [](const auto& parameters) {
                           return "Bits" + std::to_string(parameters.param.position_bits) +
                                  "Speed" + std::to_string(parameters.param.speed);
                         });

TEST(DrcGrid, CoversTheMeshExactly) {
  const auto meshes = test::meshes_to_encode();
  const mesh::Mesh& mesh = meshes[2].mesh;
  const DecodedMesh decoded = decode_in_process(encoded(mesh, MeshFormat::kDrc, {8, 7}));
  const Grid grid = grid_of(mesh, 8);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto at_axis = [&](const auto& point) { return point[axis]; };
    const auto [low, high] = std::ranges::minmax(decoded.points, {}, at_axis);
    const auto expected = std::ranges::max(mesh.positions.span(), {}, at_axis);
    EXPECT_NEAR(low[axis], grid.low[axis], grid.float_error);
    EXPECT_NEAR(high[axis], expected[axis], grid.step / 2 + grid.float_error);
  }
}

long peak_megabytes() {
  rusage usage = {};
  ::getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss / 1024;
}

// Draco counts how often every value occurs in an array of all values that there could be. Those
// that cost less come first, so that a regression ends the test before it ends the machine.
TEST(DrcGrid, TheFinestOneTakesLittleMemory) {
  constexpr long kMostMegabytes = 300;
  const auto meshes = test::meshes_to_encode();
  const mesh::Mesh& mesh = meshes[2].mesh;
  const long before = peak_megabytes();
  for (const DracoParameters& parameters :
       {DracoParameters{30, 7}, DracoParameters{26, 0}, DracoParameters{30, 0}}) {
    const std::string drc = encoded(mesh, MeshFormat::kDrc, parameters);
    ASSERT_LT(peak_megabytes() - before, kMostMegabytes)
        << parameters.position_bits << " bits, speed " << parameters.speed;
    expect_same_mesh(decode_in_process(drc), mesh, parameters.position_bits);
    expect_same_mesh(test::decode_with_command(drc), mesh, parameters.position_bits);
  }
}

TEST(Drc, AnEmptyMeshIsAStreamOfNothing) {
  const std::string drc = encoded(mesh::Mesh{}, MeshFormat::kDrc);
  EXPECT_TRUE(drc.starts_with("DRACO"));
  const DecodedMesh decoded = decode_in_process(drc);
  EXPECT_TRUE(decoded.points.empty());
  EXPECT_TRUE(decoded.triangles.empty());
}

TEST(Drc, AnEmptyMeshDecodesByDebiansCommand) {
  const DecodedMesh decoded = test::decode_with_command(encoded(mesh::Mesh{}, MeshFormat::kDrc));
  EXPECT_TRUE(decoded.points.empty());
  EXPECT_TRUE(decoded.triangles.empty());
}

TEST(Drc, TheSameMeshGivesTheSameBytes) {
  const mesh::Mesh mesh = test::large_mesh();
  EXPECT_EQ(encoded(mesh, MeshFormat::kDrc), encoded(mesh, MeshFormat::kDrc));
}

TEST(Drc, FewerBitsAreFewerBytes) {
  const mesh::Mesh mesh = test::large_mesh();
  EXPECT_LT(encoded(mesh, MeshFormat::kDrc, {8, 7}).size(),
            encoded(mesh, MeshFormat::kDrc, {24, 7}).size());
}

TEST(Drc, ALargeMeshKeepsItsCounts) {
  const mesh::Mesh mesh = test::large_mesh();
  const DecodedMesh decoded = test::decode_with_command(encoded(mesh, MeshFormat::kDrc));
  EXPECT_EQ(decoded.points.size(), mesh.positions.size());
  EXPECT_EQ(decoded.triangles.size(), mesh.triangles.size());
}

TEST(Drc, ACancelledOneThrowsAndWritesNothing) {
  std::stop_source source;
  source.request_stop();
  std::size_t bytes = 0;
  EXPECT_EQ(test::code_thrown_by([&] {
              encode_drc(test::large_mesh(), {}, {source.get_token(), {}},
                         [&](std::span<const std::byte> piece) { bytes += piece.size(); });
            }),
            ErrorCode::kCancelled);
  EXPECT_EQ(bytes, 0U);
}

TEST(Drc, ReportsItsEnd) {
  double last = 0;
  encode_drc(test::large_mesh(), {}, {{}, [&](double done) { last = done; }}, [](auto) {});
  EXPECT_EQ(last, 1);
}

TEST(Drc, PassesOnWhatItsSinkThrows) {
  const auto full = [](std::span<const std::byte>) {
    throw Error(ErrorCode::kOutOfSpace, "no space");
  };
  EXPECT_EQ(test::code_thrown_by([&] { encode_drc(test::large_mesh(), {}, {}, full); }),
            ErrorCode::kOutOfSpace);
}

}  // namespace
}  // namespace isomesh::codec
