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

// The codecs of arrays on the same grid as Draco's.
class ArrayGlb : public testing::TestWithParam<GlbCodec> {
 protected:
  static std::string glb_of(const mesh::Mesh& mesh, int bits = DracoParameters{}.position_bits) {
    return encoded(mesh, MeshFormat::kGlb, with_codec(GetParam(), bits));
  }
};

TEST_P(ArrayGlb, IsTheSameSurfaceForReadersThatAreNotOurs) {
  std::vector<std::string> extensions = {"KHR_mesh_quantization"};
  if (GetParam() == GlbCodec::kMeshopt)
    extensions.insert(extensions.begin(), "EXT_meshopt_compression");
  if (GetParam() == GlbCodec::kKhrMeshopt)
    extensions.insert(extensions.begin(), "KHR_meshopt_compression");
  for (const auto& [name, mesh] : test::meshes_to_encode()) {
    if (name.starts_with("flat") || name == "oblique") continue;  // node takes its time to start
    SCOPED_TRACE(name);
    const std::string glb = glb_of(mesh);
    const nlohmann::json document = test::open_container(glb).document;
    EXPECT_EQ(document["extensionsRequired"], nlohmann::json(extensions));
    EXPECT_EQ(document["extensionsUsed"], document["extensionsRequired"]);
    test::expect_same_mesh(whole(test::read_with_node(glb)), mesh, DracoParameters{}.position_bits);
    test::expect_same_mesh(read_back(glb), mesh, DracoParameters{}.position_bits);
  }
}

TEST_P(ArrayGlb, OfSeveralBlocksHasTheSamePlacesOnBothSidesOfASeam) {
  const mesh::Mesh mesh = test::several_blocks();
  const std::string glb = glb_of(mesh, 16);
  const auto primitives = test::read_with_node(glb);
  ASSERT_GT(primitives.size(), 2U);
  EXPECT_EQ(whole(primitives).points.size(), mesh.positions.size());
  test::expect_same_mesh(read_back(glb), mesh, 16);
}

TEST_P(ArrayGlb, KeepsCoordinatesOfMoreThan16BitsAsTheyAre) {
  const mesh::Mesh mesh = std::move(test::meshes_to_encode().at(3).mesh);
  const std::string glb = glb_of(mesh, 17);
  const test::DecodedMesh read = read_back(glb);
  std::vector<Vec3> expected(mesh.positions.begin(), mesh.positions.end());
  std::vector<Vec3> found = read.points;
  std::ranges::sort(expected);
  std::ranges::sort(found);
  EXPECT_TRUE(found == expected);
  EXPECT_EQ(whole(test::read_with_node(glb)).triangles.size(), mesh.triangles.size());
}

TEST_P(ArrayGlb, RequiresQuantizationOnlyIfNumbersAreRounded) {
  Provenance provenance = with_codec(GetParam(), 17);
  const auto is_required = [&] {
    const std::string glb = encoded(test::large_mesh(), MeshFormat::kGlb, provenance);
    const std::string text = test::open_container(glb).document.dump();
    return text.find("KHR_mesh_quantization") != std::string::npos;
  };
  EXPECT_TRUE(is_required());
  provenance.parameters.normals = false;
  EXPECT_FALSE(is_required());
}

TEST_P(ArrayGlb, IsTheSameOnAnyNumberOfThreads) {
  test::expect_same_on_any_threads([] { return glb_of(test::large_mesh()); });
}

TEST_P(ArrayGlb, OfNothingIsAFileWithoutAMesh) {
  EXPECT_TRUE(test::read_with_node(glb_of(mesh::Mesh{})).empty());
}

std::string name_of_codec(const testing::TestParamInfo<GlbCodec>& test) {
  std::string name(to_string(test.param));
  std::ranges::replace(name, '-', '_');
  return name;
}

INSTANTIATE_TEST_SUITE_P(Codecs, ArrayGlb,
                         testing::Values(GlbCodec::kMeshopt, GlbCodec::kKhrMeshopt,
                                         GlbCodec::kQuantized),
                         name_of_codec);

TEST(KhrMeshoptGlb, HasTheStreamsOfTheOlderName) {
  const mesh::Mesh mesh = test::several_blocks();
  const auto binary_of = [&](GlbCodec codec) {
    return test::open_container(encoded(mesh, MeshFormat::kGlb, with_codec(codec))).binary;
  };
  EXPECT_EQ(binary_of(GlbCodec::kMeshopt), binary_of(GlbCodec::kKhrMeshopt));
}

// Indices of 16 bits must not be the largest, which glTF reserves.
TEST(QuantizedGlb, HasIndicesOf16BitsWhereTheySuffice) {
  const mesh::Mesh mesh = test::several_blocks();
  for (const bool merge : {false, true}) {
    Provenance provenance = with_codec(GlbCodec::kQuantized);
    provenance.parameters.merge = merge;
    const nlohmann::json document =
        test::open_container(encoded(mesh, MeshFormat::kGlb, provenance)).document;
    for (const auto& primitive : document["meshes"][0]["primitives"]) {
      const auto& indices = document["accessors"][primitive["indices"].get<std::size_t>()];
      const auto& positions =
          document["accessors"][primitive["attributes"]["POSITION"].get<std::size_t>()];
      EXPECT_EQ(positions["count"] > 65535, merge);
      EXPECT_EQ(indices["componentType"], merge ? 5125 : 5123);
    }
  }
}

// Triangles that share no vertex, except for the last of them.
mesh::Mesh triangles_of(std::uint32_t vertices) {
  mesh::Mesh mesh;
  mesh.positions.resize_for_overwrite(vertices);
  mesh.triangles.resize_for_overwrite((vertices + 2) / 3);
  for (std::uint32_t v = 0; v < vertices; ++v) {
    const std::uint32_t triangle = v / 3;
    const std::uint32_t corner = v % 3;
    mesh.positions[v] = {static_cast<float>(2 * (triangle % 256) + (corner == 1 ? 1 : 0)),
                         static_cast<float>(2 * (triangle / 256) + (corner == 2 ? 1 : 0)), 0};
    if (corner == 2 || v + 1 == vertices) mesh.triangles[triangle] = {v - 2, v - 1, v};
  }
  mesh.layer_vertices = {0, mesh.positions.size()};
  mesh.layer_triangles = {0, mesh.triangles.size()};
  return mesh;
}

TEST(QuantizedGlb, HasIndicesOf16BitsUpTo65535Vertices) {
  for (const std::uint32_t vertices : {65535U, 65536U}) {
    const mesh::Mesh mesh = triangles_of(vertices);
    Provenance provenance = with_codec(GlbCodec::kQuantized, 16);
    provenance.parameters.merge = true;
    const std::string glb = encoded(mesh, MeshFormat::kGlb, provenance);
    const nlohmann::json document = test::open_container(glb).document;
    const auto& primitive = document["meshes"][0]["primitives"][0];
    const auto& indices = document["accessors"][primitive["indices"].get<std::size_t>()];
    EXPECT_EQ(indices["componentType"], vertices == 65535 ? 5123 : 5125);
    const auto primitives = test::read_with_node(glb);
    ASSERT_EQ(primitives.size(), 1U);
    EXPECT_EQ(primitives[0].mesh.points.size(), vertices);
    test::expect_same_mesh(primitives[0].mesh, mesh, 16);
    test::expect_same_mesh(read_back(glb), mesh, 16);
  }
}

// The normals by the places of their vertices.
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

TEST_P(ArrayGlb, HasNormalsOfEightBits) {
  const mesh::Mesh mesh = std::move(test::meshes_to_encode().at(2).mesh);
  const auto draco = normals_in(
      test::read_with_node(encoded(mesh, MeshFormat::kGlb, with_codec(GlbCodec::kDraco, 20))));
  const auto arrays = normals_in(test::read_with_node(glb_of(mesh, 20)));
  ASSERT_EQ(arrays.size(), mesh.positions.size());
  ASSERT_EQ(draco.size(), mesh.positions.size());
  for (auto a = draco.begin(), b = arrays.begin(); a != draco.end(); ++a, ++b) {
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

INSTANTIATE_TEST_SUITE_P(Codecs, MergedGlb,
                         testing::Values(GlbCodec::kDraco, GlbCodec::kMeshopt,
                                         GlbCodec::kQuantized),
                         name_of_codec);

class ArrayGlbOfLabels : public test::LabelFilesTest,
                         public testing::WithParamInterface<GlbCodec> {};

TEST_P(ArrayGlbOfLabels, SharesWallsAndHasCoarserLevels) {
  provenance_.parameters.glb_codec = GetParam();
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

INSTANTIATE_TEST_SUITE_P(Codecs, ArrayGlbOfLabels,
                         testing::Values(GlbCodec::kMeshopt, GlbCodec::kQuantized), name_of_codec);

}  // namespace
}  // namespace isomesh::codec
