// The compression of the surface in a GLB, and its number of primitives.
#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "server/codec/decode/decode.h"
#include "server/codec/encode.h"
#include "server/mesh/measure/normals.h"
#include "tests/support/any_threads.h"
#include "tests/support/kernels.h"
#include "tests/unit/codec/foreign.h"
#include "tests/unit/codec/glb_container.h"
#include "tests/unit/codec/label_files.h"
#include "tests/unit/codec/meshes.h"
#include "tests/unit/codec/same_mesh.h"

namespace isomesh::codec {
namespace {

using mesh::Vec3;
using test::encoded;

Provenance with_codec(GlbCodec codec, int position_bits = DracoParameters{}.position_bits) {
  Provenance provenance;
  provenance.parameters.glb_codec = codec;
  provenance.parameters.draco.position_bits = position_bits;
  return provenance;
}

test::DecodedMesh whole(const std::vector<test::GlbPrimitive>& primitives) {
  std::vector<test::DecodedMesh> parts;
  for (const auto& primitive : primitives) parts.push_back(primitive.mesh);
  return test::welded(parts);
}

test::DecodedMesh read_back(const std::string& glb) {
  const DecodedSurface surface =
      decode(std::as_bytes(std::span(glb)), MeshFormat::kGlb, Space::kLps, {});
  return test::welded({{{surface.positions.begin(), surface.positions.end()},
                        {surface.triangles.begin(), surface.triangles.end()}}});
}

TEST(MeshoptGlb, IsTheSameSurfaceForMeshoptimizersOwnDecoder) {
  for (const auto& [name, mesh] : test::meshes_to_encode()) {
    if (name.starts_with("flat") || name == "oblique") continue;  // node takes its time to start
    SCOPED_TRACE(name);
    const std::string glb = encoded(mesh, MeshFormat::kGlb, with_codec(GlbCodec::kMeshopt));
    EXPECT_EQ(test::open_container(glb).document["extensionsRequired"],
              nlohmann::json({"EXT_meshopt_compression", "KHR_mesh_quantization"}));
    test::expect_same_mesh(whole(test::read_with_node(glb)), mesh, DracoParameters{}.position_bits);
    test::expect_same_mesh(read_back(glb), mesh, DracoParameters{}.position_bits);
  }
}

TEST(MeshoptGlb, OfSeveralBlocksHasTheSamePlacesOnBothSidesOfASeam) {
  const mesh::Mesh mesh = test::several_blocks();
  const std::string glb = encoded(mesh, MeshFormat::kGlb, with_codec(GlbCodec::kMeshopt, 16));
  const auto primitives = test::read_with_node(glb);
  ASSERT_GT(primitives.size(), 2U);
  EXPECT_EQ(whole(primitives).points.size(), mesh.positions.size());
  test::expect_same_mesh(read_back(glb), mesh, 16);
}

TEST(MeshoptGlb, KeepsCoordinatesOfMoreThan16BitsAsTheyAre) {
  const mesh::Mesh mesh = std::move(test::meshes_to_encode().at(3).mesh);
  const std::string glb = encoded(mesh, MeshFormat::kGlb, with_codec(GlbCodec::kMeshopt, 17));
  const test::DecodedMesh read = read_back(glb);
  std::vector<Vec3> expected(mesh.positions.begin(), mesh.positions.end());
  std::vector<Vec3> found = read.points;
  std::ranges::sort(expected);
  std::ranges::sort(found);
  EXPECT_TRUE(found == expected);
  EXPECT_EQ(whole(test::read_with_node(glb)).triangles.size(), mesh.triangles.size());
}

TEST(MeshoptGlb, IsTheSameOnAnyNumberOfThreads) {
  test::expect_same_on_any_threads(
      [] { return encoded(test::large_mesh(), MeshFormat::kGlb, with_codec(GlbCodec::kMeshopt)); });
}

TEST(MeshoptGlb, OfNothingIsAFileWithoutAMesh) {
  const std::string glb = encoded(mesh::Mesh{}, MeshFormat::kGlb, with_codec(GlbCodec::kMeshopt));
  EXPECT_TRUE(test::read_with_node(glb).empty());
}

// At each place the normal that was found there.
std::map<Vec3, Vec3> normals_in(const std::vector<test::GlbPrimitive>& primitives) {
  std::map<Vec3, Vec3> found;
  for (const auto& primitive : primitives) {
    EXPECT_EQ(primitive.normals.size(), primitive.mesh.points.size());
    for (std::size_t v = 0; v < primitive.normals.size(); ++v) {
      found.emplace(primitive.mesh.points[v], primitive.normals[v]);
    }
  }
  return found;
}

double degrees_between(const Vec3& a, const Vec3& b) {
  const double dot = double{a[0]} * b[0] + double{a[1]} * b[1] + double{a[2]} * b[2];
  const double lengths = std::hypot(double{a[0]}, double{a[1]}, double{a[2]}) *
                         std::hypot(double{b[0]}, double{b[1]}, double{b[2]});
  return std::acos(std::clamp(dot / lengths, -1.0, 1.0)) * 57.29577951308232;
}

TEST(MeshoptGlb, HasNormalsOfEightBits) {
  const mesh::Mesh mesh = std::move(test::meshes_to_encode().at(2).mesh);
  const auto draco = normals_in(
      test::read_with_node(encoded(mesh, MeshFormat::kGlb, with_codec(GlbCodec::kDraco, 20))));
  Provenance provenance = with_codec(GlbCodec::kMeshopt, 20);
  const auto meshopt =
      normals_in(test::read_with_node(encoded(mesh, MeshFormat::kGlb, provenance)));
  ASSERT_EQ(meshopt.size(), mesh.positions.size());
  ASSERT_EQ(draco.size(), mesh.positions.size());
  for (auto a = draco.begin(), b = meshopt.begin(); a != draco.end(); ++a, ++b) {
    EXPECT_LT(degrees_between(a->second, b->second), 1.5);
  }
}

// The bytes that one encoder and the other write hold the same normals.
TEST(DracoNormals, AreThoseOfLibdracoFromOurOwnEncoder) {
  for (const std::size_t which : {std::size_t{2}, std::size_t{7}}) {
    const mesh::Mesh mesh = std::move(test::meshes_to_encode().at(which).mesh);
    const auto with_speed = [&](int speed) {
      Provenance provenance = with_codec(GlbCodec::kDraco, 16);
      provenance.parameters.draco.speed = speed;
      return normals_in(test::read_with_node(encoded(mesh, MeshFormat::kGlb, provenance)));
    };
    const auto ours = with_speed(7);
    EXPECT_EQ(ours.size(), mesh.positions.size());
    EXPECT_TRUE(ours == with_speed(4)) << which;
  }
}

class MergedGlb : public testing::TestWithParam<GlbCodec> {};

TEST_P(MergedGlb, IsOnePrimitive) {
  const mesh::Mesh mesh = test::several_blocks();
  Provenance provenance = with_codec(GetParam(), 16);
  provenance.parameters.merge = true;
  const std::string glb = encoded(mesh, MeshFormat::kGlb, provenance);
  const auto primitives = test::read_with_node(glb);
  ASSERT_EQ(primitives.size(), 1U);
  EXPECT_EQ(primitives[0].mesh.points.size(), mesh.positions.size());
  EXPECT_EQ(primitives[0].normals.size(), mesh.positions.size());
  test::expect_same_mesh(primitives[0].mesh, mesh, 16);
  test::expect_same_mesh(read_back(glb), mesh, 16);
}

TEST_P(MergedGlb, IsTheSameOnAnyNumberOfThreads) {
  const mesh::Mesh mesh = test::several_blocks();
  Provenance provenance = with_codec(GetParam());
  provenance.parameters.merge = true;
  test::expect_same_on_any_threads([&] { return encoded(mesh, MeshFormat::kGlb, provenance); });
}

INSTANTIATE_TEST_SUITE_P(Codecs, MergedGlb, testing::Values(GlbCodec::kDraco, GlbCodec::kMeshopt),
                         [](const auto& test) { return std::string(to_string(test.param)); });

class MeshoptGlbOfLabels : public test::LabelFilesTest {};

TEST_F(MeshoptGlbOfLabels, SharesWallsAndHasCoarserLevels) {
  provenance_.parameters.glb_codec = GlbCodec::kMeshopt;
  provenance_.parameters.merge = true;
  const auto primitives = test::read_with_node(encoded(MeshFormat::kGlb));
  ASSERT_EQ(primitives.size(), kLabels);
  std::vector<Places> places;
  for (std::size_t n = 0; n < kLabels; ++n) {
    EXPECT_EQ(primitives[n].mesh.triangles.size(), labels_[n].triangles);
    places.push_back({primitives[n].mesh.points.begin(), primitives[n].mesh.points.end()});
  }
  expect_shared(places);
  provenance_.parameters.lods = {1, 0.3};
  EXPECT_GT(test::read_with_node(encoded(MeshFormat::kGlb)).size(), kLabels);
}

}  // namespace
}  // namespace isomesh::codec
