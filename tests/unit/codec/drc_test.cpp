// Tests of `drc` files, decoded by libdraco and by Debian's draco_decoder, which must be installed.
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
#include "tests/unit/codec/same_mesh.h"

namespace isomesh::codec {
namespace {

using test::decode_in_process;
using test::DecodedMesh;
using test::encoded;
using test::expect_same_mesh;
using test::Grid;
using test::grid_of;

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

TEST(DrcGrid, CoversTheMesh) {
  const auto meshes = test::meshes_to_encode();
  const mesh::Mesh& mesh = meshes[2].mesh;
  const DecodedMesh decoded = decode_in_process(encoded(mesh, MeshFormat::kDrc, {8, 7}));
  const Grid grid = grid_of(mesh, 8);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto at_axis = [&](const auto& point) { return point[axis]; };
    const auto [low, high] = std::ranges::minmax(decoded.points, {}, at_axis);
    const auto lowest = std::ranges::min(mesh.positions.span(), {}, at_axis);
    const auto highest = std::ranges::max(mesh.positions.span(), {}, at_axis);
    EXPECT_NEAR(low[axis], lowest[axis], grid.step / 2 + grid.float_error);
    EXPECT_NEAR(high[axis], highest[axis], grid.step / 2 + grid.float_error);
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
