// Levels of detail in GLB.
#include <algorithm>
#include <set>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "server/codec/formats.h"
#include "tests/support/errors.h"
#include "tests/support/kernels.h"
#include "tests/support/mesh_checks.h"
#include "tests/unit/codec/foreign.h"
#include "tests/unit/codec/glb_container.h"
#include "tests/unit/codec/label_files.h"
#include "tests/unit/codec/meshes.h"
#include "tests/unit/codec/same_mesh.h"

namespace isomesh::codec {
namespace {

using nlohmann::json;
using test::DecodedMesh;
using test::open_container;

const std::vector<double> kShares = {1, 0.25, 0.05};

Provenance with_lods(const std::vector<double>& lods) {
  Provenance provenance;
  provenance.parameters.lods = lods;
  return provenance;
}

std::string encoded_with(const mesh::Mesh& mesh, const std::vector<double>& lods) {
  return test::encoded(mesh, MeshFormat::kGlb, with_lods(lods));
}

const mesh::Mesh& sphere() {
  static const mesh::Mesh mesh = test::several_blocks();
  return mesh;
}

const std::string& sphere_with_lods() {
  static const std::string glb = encoded_with(sphere(), kShares);
  return glb;
}

// Decodes each mesh of the file with independent readers and welds its primitives. Throws if the
// validator finds an error or a warning.
std::vector<DecodedMesh> decoded_meshes(const std::string& glb) {
  const auto primitives = test::read_with_node(glb);
  std::vector<DecodedMesh> meshes;
  std::size_t next = 0;
  const json document = open_container(glb).document;
  for (const json& mesh : document["meshes"]) {
    std::vector<DecodedMesh> parts;
    for (std::size_t n = 0; n < mesh["primitives"].size(); ++n) {
      parts.push_back(primitives.at(next++).mesh);
    }
    meshes.push_back(test::welded(parts));
  }
  EXPECT_EQ(next, primitives.size());
  return meshes;
}

std::set<mesh::Vec3> places_of(const DecodedMesh& mesh) {
  return {mesh.points.begin(), mesh.points.end()};
}

// Byte offset of the mesh's first Draco stream in the file's binary data.
std::size_t begin_of(const json& document, const json& mesh) {
  const json& draco = mesh["primitives"][0]["extensions"]["KHR_draco_mesh_compression"];
  return document["bufferViews"][draco["bufferView"].get<std::size_t>()]["byteOffset"];
}

TEST(Lods, AreNodesOutsideTheSceneThatTheFinestNames) {
  const json document = open_container(sphere_with_lods()).document;
  EXPECT_EQ(document["extensionsUsed"], json({"KHR_draco_mesh_compression", "MSFT_lod"}));
  EXPECT_EQ(document["extensionsRequired"], json({"KHR_draco_mesh_compression"}));
  EXPECT_EQ(document["scenes"], json::parse(R"([{"nodes": [0]}])"));
  const json& nodes = document["nodes"];
  ASSERT_EQ(nodes.size(), 3U);
  EXPECT_EQ(nodes[0]["extensions"]["MSFT_lod"]["ids"], json({1, 2}));
  EXPECT_EQ(nodes[0]["extras"]["MSFT_screencoverage"], json({0.25, 0.05, 0}));
  for (std::size_t level = 0; level < 3; ++level) {
    EXPECT_EQ(nodes[level]["mesh"], level);
    EXPECT_EQ(nodes[level]["rotation"], nodes[0]["rotation"]);
    EXPECT_EQ(nodes[level]["scale"], nodes[0]["scale"]);
    EXPECT_EQ(nodes[level].contains("extensions"), level == 0);
  }
  EXPECT_EQ(document["asset"]["extras"]["parameters"]["lods"], json(kShares));
}

TEST(Lods, CoarserOnesComeFirstInTheFile) {
  const json document = open_container(sphere_with_lods()).document;
  EXPECT_EQ(begin_of(document, document["meshes"][2]), 0U);
  EXPECT_LT(begin_of(document, document["meshes"][2]), begin_of(document, document["meshes"][1]));
  EXPECT_LT(begin_of(document, document["meshes"][1]), begin_of(document, document["meshes"][0]));
}

TEST(Lods, HaveTheirSharesOfTheTrianglesAndAreAsClosedAsTheFinest) {
  const mesh::Mesh& mesh = sphere();
  const auto levels = decoded_meshes(sphere_with_lods());
  ASSERT_EQ(levels.size(), kShares.size());
  test::expect_same_mesh(levels[0], mesh, DracoParameters{}.position_bits);
  const auto finest = places_of(levels[0]);
  for (std::size_t level = 1; level < levels.size(); ++level) {
    SCOPED_TRACE(level);
    const auto wanted = kShares[level] * static_cast<double>(mesh.triangles.size());
    const auto has = static_cast<double>(levels[level].triangles.size());
    EXPECT_LT(has, 1.1 * wanted);
    EXPECT_GT(has, 0.5 * wanted);
    const auto places = places_of(levels[level]);
    EXPECT_TRUE(std::ranges::includes(finest, places)) << "another grid";
    test::Surface surface;
    for (const auto& point : levels[level].points) {
      surface.points.push_back({point[0], point[1], point[2]});
    }
    surface.triangles = levels[level].triangles;
    const test::TopologyFacts topology = test::topology_of(surface);
    EXPECT_TRUE(topology.boundary_edges.empty());
    EXPECT_EQ(topology.crowded_edges, 0U);
    EXPECT_EQ(topology.misoriented_edges, 0U);
    EXPECT_EQ(topology.euler, 2);
    const double volume = test::extent_of(test::surface_of(mesh)).volume;
    EXPECT_NEAR(test::extent_of(surface).volume, volume, 0.01 * volume);
  }
}

TEST(Lods, WhoDoesNotKnowThemReadsTheFinest) {
  const mesh::Mesh& mesh = sphere();
  const std::string& glb = sphere_with_lods();
  const DecodedSurface surface =
      decode(std::as_bytes(std::span(glb)), MeshFormat::kGlb, Space::kLps, {});
  EXPECT_EQ(surface.triangles.size(), mesh.triangles.size());
}

TEST(Lods, HaveNormalsWhereTheyAreAskedFor) {
  Provenance provenance = with_lods(kShares);
  provenance.parameters.normals = true;
  const auto primitives =
      test::read_with_node(test::encoded(sphere(), MeshFormat::kGlb, provenance));
  ASSERT_GT(primitives.size(), kShares.size());
  for (const auto& primitive : primitives) {
    EXPECT_EQ(primitive.normals.size(), primitive.mesh.points.size());
  }
}

// A mesh that cannot lose triangles has no coarser level: a triangle, a mesh that is all boundary.
TEST(Lods, ThatGainNothingAreLeftOut) {
  for (const auto& [name, mesh] : test::meshes_to_encode()) {
    SCOPED_TRACE(name);
    const json document = open_container(encoded_with(mesh, {1, 0.9, 0.2, 0.1, 0.0001})).document;
    std::size_t before = mesh.triangles.size() + 1;
    for (const json& level : document["meshes"]) {
      std::size_t triangles = 0;
      for (const json& primitive : level["primitives"]) {
        const json& indices = document["accessors"][primitive["indices"].get<std::size_t>()];
        triangles += indices["count"].get<std::size_t>() / 3;
      }
      EXPECT_LT(triangles, before);
      EXPECT_GT(triangles, 0U);
      before = triangles;
    }
    const std::size_t levels = document["meshes"].size();
    const json& node = document["nodes"][0];
    EXPECT_EQ(document["nodes"].size(), levels);
    EXPECT_EQ(node.contains("extensions"), levels > 1);
    if (levels > 1) {
      EXPECT_EQ(node["extras"]["MSFT_screencoverage"].size(), levels);
      EXPECT_EQ(node["extensions"]["MSFT_lod"]["ids"].size(), levels - 1);
    }
    EXPECT_EQ(levels == 1, name == "triangle" || name == "two apart");
  }
}

TEST(Lods, OfAnEmptySurfaceAreNone) {
  const auto container = open_container(encoded_with(mesh::Mesh{}, kShares));
  EXPECT_FALSE(container.document.contains("meshes"));
  EXPECT_FALSE(container.document["nodes"][0].contains("extensions"));
  EXPECT_TRUE(test::read_with_node(encoded_with(mesh::Mesh{}, kShares)).empty());
}

TEST(Lods, OneLevelIsAFileWithoutLevels) {
  json one = open_container(encoded_with(sphere(), {1})).document;
  const json none = open_container(encoded_with(sphere(), {})).document;
  EXPECT_EQ(one["asset"]["extras"]["parameters"]["lods"], json({1}));
  one["asset"] = none["asset"];
  EXPECT_EQ(one, none);
}

TEST(Lods, AreTheSameToTheByteOnAnyNumberOfThreads) {
  const mesh::Mesh& mesh = sphere();
  for (const int threads : {1, 16}) {
    const test::ThreadCount count(threads);
    EXPECT_TRUE(encoded_with(mesh, kShares) == sphere_with_lods()) << threads;
  }
}

TEST(Lods, TellTheirProgressAndEndWhenTheyAreCancelled) {
  const mesh::Mesh& mesh = sphere();
  const Sink nowhere = [](std::span<const std::byte>) {};
  double most = 0;
  encode(mesh, MeshFormat::kGlb, with_lods(kShares),
         {{}, [&](double done) { most = std::max(most, done); }}, nowhere);
  EXPECT_NEAR(most, 1, 1e-9);

  std::stop_source stop;
  const auto stop_soon = [&](double done) {
    if (done > 0.4) stop.request_stop();
  };
  EXPECT_EQ(
      test::code_thrown_by([&] {
        encode(mesh, MeshFormat::kGlb, with_lods(kShares), {stop.get_token(), stop_soon}, nowhere);
      }),
      ErrorCode::kCancelled);
}

TEST(Lods, MakeAFileLargerAndTakeMemory) {
  const mesh::Mesh& mesh = sphere();
  const mesh::SurfaceSize size = {mesh.triangles.size(), mesh.positions.size()};
  const Format& glb = describe(MeshFormat::kGlb);
  const MeshParameters parameters = with_lods(kShares).parameters;
  EXPECT_GT(glb.bytes(size, parameters), glb.bytes(size, {}));
  EXPECT_GT(glb.memory_bytes(size, parameters), glb.memory_bytes(size, {}));
  const auto bytes = static_cast<double>(sphere_with_lods().size());
  EXPECT_LT(glb.bytes(size, parameters), 2 * bytes);
  EXPECT_GT(2 * glb.bytes(size, parameters), bytes);
}

class LodsOfLabels : public test::LabelFilesTest {};

TEST_F(LodsOfLabels, AreBelowEachLabelAndHaveTheirWallsInCommon) {
  provenance_.parameters.lods = {1, 0.5};
  const std::string glb = encoded(MeshFormat::kGlb);
  const json document = open_container(glb).document;
  const auto meshes = decoded_meshes(glb);
  const json& nodes = document["nodes"];
  std::vector<std::set<mesh::Vec3>> finest;
  std::vector<std::set<mesh::Vec3>> coarser;
  std::size_t triangles = 0;
  std::set<std::size_t> named;
  for (const json& child : nodes[0]["children"]) {
    const json& node = nodes[child.get<std::size_t>()];
    ASSERT_EQ(node["extensions"]["MSFT_lod"]["ids"].size(), 1U);
    EXPECT_EQ(node["extras"]["MSFT_screencoverage"], json({0.5, 0}));
    const auto id = node["extensions"]["MSFT_lod"]["ids"][0].get<std::size_t>();
    EXPECT_GT(id, kLabels);
    EXPECT_TRUE(named.insert(id).second);
    EXPECT_FALSE(nodes[id].contains("scale")) << "the root has it for all";
    finest.push_back(places_of(meshes.at(node["mesh"].get<std::size_t>())));
    const DecodedMesh& level = meshes.at(nodes[id]["mesh"].get<std::size_t>());
    coarser.push_back(places_of(level));
    triangles += level.triangles.size();
    const auto material = [&](const json& of) {
      return document["meshes"][of["mesh"].get<std::size_t>()]["primitives"][0]["material"];
    };
    EXPECT_EQ(material(node), material(nodes[id]));
  }
  ASSERT_EQ(finest.size(), kLabels);
  EXPECT_EQ(nodes.size(), 1 + 2 * kLabels);
  expect_shared(finest);
  std::size_t all = 0;
  for (const LabelSummary& label : labels_) all += label.triangles;
  EXPECT_LT(triangles, all);
  // A wall's places on one side are those on the other: what only one of two neighbours has lies on
  // none of the walls between them.
  for (std::size_t a = 0; a < kLabels; ++a) {
    EXPECT_TRUE(std::ranges::includes(finest[a], coarser[a])) << "another grid";
    for (std::size_t b = 0; b < kLabels; ++b) {
      for (const mesh::Vec3& place : coarser[a]) {
        if (a != b && finest[b].contains(place)) {
          EXPECT_TRUE(coarser[b].contains(place)) << a + 1 << " and " << b + 1;
        }
      }
    }
  }
}

}  // namespace
}  // namespace isomesh::codec
