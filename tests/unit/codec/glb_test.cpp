// GLB is taken apart here by what glTF's specification says of it, and its streams by libdraco.
#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "proto/json.h"
#include "server/codec/formats.h"
#include "tests/support/any_threads.h"
#include "tests/support/errors.h"
#include "tests/support/kernels.h"
#include "tests/support/mesh_checks.h"
#include "tests/unit/codec/decode.h"
#include "tests/unit/codec/glb_container.h"
#include "tests/unit/codec/meshes.h"
#include "tests/unit/codec/same_mesh.h"

namespace isomesh::codec {
namespace {

using nlohmann::json;
using test::DecodedMesh;
using test::encoded;
using test::GlbContainer;
using test::open_container;
using test::several_blocks;
using test::welded;

// The primitives decoded, each checked against its accessors.
std::vector<DecodedMesh> decoded_primitives(const GlbContainer& container) {
  const json& document = container.document;
  std::vector<DecodedMesh> result;
  for (const json& primitive : document["meshes"][0]["primitives"]) {
    const json& draco = primitive["extensions"]["KHR_draco_mesh_compression"];
    const json& view = document["bufferViews"][draco["bufferView"].get<std::size_t>()];
    EXPECT_EQ(view["byteOffset"].get<std::size_t>() % 4, 0U);
    DecodedMesh& mesh = result.emplace_back(
        test::decode_in_process(container.binary.substr(view["byteOffset"], view["byteLength"])));
    const json& positions =
        document["accessors"][primitive["attributes"]["POSITION"].get<std::size_t>()];
    const json& indices = document["accessors"][primitive["indices"].get<std::size_t>()];
    EXPECT_EQ(positions["count"], mesh.points.size());
    EXPECT_EQ(indices["count"], mesh.triangles.size() * 3);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto [low, high] = std::ranges::minmax_element(
          mesh.points, {}, [&](const auto& point) { return point[axis]; });
      EXPECT_EQ(positions["min"][axis].get<float>(), (*low)[axis]);
      EXPECT_EQ(positions["max"][axis].get<float>(), (*high)[axis]);
    }
  }
  return result;
}

TEST(Glb, CarriesTheMeshInBlocksWhoseSeamsFit) {
  const mesh::Mesh mesh = several_blocks();
  const GlbContainer container = open_container(encoded(mesh, MeshFormat::kGlb, {16, 7}));
  const auto parts = decoded_primitives(container);
  ASSERT_GT(parts.size(), 2U) << "one block has no seams: " << mesh.triangles.size();
  const DecodedMesh whole = welded(parts);
  EXPECT_EQ(whole.points.size(), mesh.positions.size());
  EXPECT_EQ(whole.triangles.size(), mesh.triangles.size());

  test::Surface surface;
  for (const auto& point : whole.points) surface.points.push_back({point[0], point[1], point[2]});
  surface.triangles = whole.triangles;
  const test::TopologyFacts topology = test::topology_of(surface);
  EXPECT_TRUE(topology.boundary_edges.empty()) << "the seams leak";
  EXPECT_EQ(topology.crowded_edges, 0U);
  EXPECT_EQ(topology.misoriented_edges, 0U);
  EXPECT_EQ(topology.euler, 2);
  EXPECT_NEAR(test::extent_of(surface).volume, test::extent_of(test::surface_of(mesh)).volume,
              1e-3 * test::extent_of(surface).volume);
}

TEST(Glb, IsTheSameToTheByteOnAnyNumberOfThreads) {
  const mesh::Mesh mesh = several_blocks();
  test::expect_same_on_any_threads([&] { return encoded(mesh, MeshFormat::kGlb); });
}

TEST(Glb, EveryMeshAndSpeedDecodesToAllItsTriangles) {
  for (const auto& [name, mesh] : test::meshes_to_encode()) {
    SCOPED_TRACE(name);
    for (const int speed : {0, 7, 10}) {
      const auto parts =
          decoded_primitives(open_container(encoded(mesh, MeshFormat::kGlb, {14, speed})));
      std::size_t triangles = 0;
      for (const DecodedMesh& part : parts) triangles += part.triangles.size();
      EXPECT_EQ(triangles, mesh.triangles.size()) << speed;
    }
  }
}

TEST(Glb, ThePatientsHeadIsUpAndMetresAreTheUnit) {
  const json document = open_container(encoded(several_blocks(), MeshFormat::kGlb)).document;
  const json& node = document["nodes"][document["scenes"][0]["nodes"][0].get<std::size_t>()];
  const auto quaternion = node["rotation"].get<std::array<double, 4>>();
  const auto turned = [&](const std::array<double, 3>& v) {
    const auto& [x, y, z, w] = quaternion;
    const std::array<double, 3> t = {2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]),
                                     2 * (x * v[1] - y * v[0])};
    return std::array{v[0] + w * t[0] + y * t[2] - z * t[1], v[1] + w * t[1] + z * t[0] - x * t[2],
                      v[2] + w * t[2] + x * t[1] - y * t[0]};
  };
  const auto superior = turned({0, 0, 1});
  const auto anterior = turned({0, -1, 0});
  EXPECT_NEAR(superior[1], 1, 1e-12) << "glTF's up is +Y";
  EXPECT_NEAR(anterior[2], 1, 1e-12) << "glTF's front is +Z";
  EXPECT_EQ(node["scale"], json({0.001, 0.001, 0.001}));
}

TEST(Glb, SaysWhereItComesFrom) {
  Provenance provenance;
  provenance.samples = "abc";
  provenance.parameters.passes = 9;
  provenance.iso = 60.5;
  provenance.dims = {4, 5, 6};
  provenance.geometry.origin = {1, 2, 3};
  const std::string glb = encoded(several_blocks(), MeshFormat::kGlb, provenance);
  const json extras = open_container(glb).document["asset"]["extras"];
  EXPECT_EQ(extras["parameters"]["passes"], 9);
  EXPECT_EQ(extras["samples"], "abc");
  json all = json::parse(to_json(provenance.parameters));
  all.erase("formats");
  EXPECT_EQ(extras["parameters"], all) << "and nothing of the job's other files";
  EXPECT_EQ(extras["iso"], 60.5);
  EXPECT_EQ(extras["dims"], json({4, 5, 6}));
  EXPECT_EQ(extras["origin"], json({1.0, 2.0, 3.0}));
  EXPECT_EQ(extras["units"], "mm");
  EXPECT_EQ(extras["space"], "LPS");
}

TEST(Glb, AnEmptyMeshIsASceneWithoutOne) {
  const GlbContainer container = open_container(encoded(mesh::Mesh{}, MeshFormat::kGlb));
  EXPECT_FALSE(container.document.contains("meshes"));
  EXPECT_FALSE(container.document["nodes"][0].contains("mesh"));
  EXPECT_TRUE(container.binary.empty());
}

TEST(Glb, StopsWhenItIsCancelled) {
  std::stop_source stop;
  stop.request_stop();
  const auto code = test::code_thrown_by([&] {
    encode(several_blocks(), MeshFormat::kGlb, {}, {stop.get_token(), nullptr},
           [](std::span<const std::byte>) {});
  });
  EXPECT_EQ(code, ErrorCode::kCancelled);
}

}  // namespace
}  // namespace isomesh::codec
