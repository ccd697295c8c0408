// USD of one surface and of labels, as text and as a package.
#include <algorithm>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "server/codec/formats.h"
#include "server/codec/label_titles.h"
#include "server/mesh/measure/normals.h"
#include "tests/unit/codec/label_files.h"
#include "tests/unit/codec/meshes.h"
#include "tests/unit/codec/unzipped.h"
#include "tests/unit/codec/usd_reader.h"

namespace isomesh::codec {
namespace {

using mesh::Vec3;
using test::encoded;
using test::read_usda;
using test::UsdMesh;
using test::UsdStage;

Vec3 with_y_up(const Vec3& lps) { return {lps[0], lps[2], -lps[1]}; }

TEST(Usd, IsInMillimetresWithTheHeadUp) {
  for (const auto& [name, mesh] : test::meshes_to_encode()) {
    SCOPED_TRACE(name);
    const UsdStage stage = read_usda(encoded(mesh, MeshFormat::kUsda));
    EXPECT_EQ(stage.metres_per_unit, 0.001);
    EXPECT_EQ(stage.up_axis, "Y");
    ASSERT_EQ(stage.meshes.size(), 1U);
    const UsdMesh& read = stage.meshes[0];
    EXPECT_TRUE(std::ranges::equal(read.points, mesh.positions, {}, {}, with_y_up));
    EXPECT_TRUE(std::ranges::equal(read.triangles, mesh.triangles));
    ASSERT_EQ(read.extent.size(), 2U);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto along = [&](const Vec3& at) { return at[axis]; };
      const auto [low, high] = std::ranges::minmax_element(read.points, {}, along);
      EXPECT_EQ(read.extent[0][axis], (*low)[axis]);
      EXPECT_EQ(read.extent[1][axis], (*high)[axis]);
    }
  }
}

TEST(Usd, HasNormalsWhereTheyAreAskedFor) {
  const mesh::Mesh mesh = std::move(test::meshes_to_encode().at(2).mesh);
  mesh::Buffer<Vec3> expected;
  vertex_normals(mesh, {}, expected);
  Provenance provenance;
  provenance.parameters.normals = true;
  UsdStage stage = read_usda(encoded(mesh, MeshFormat::kUsda, provenance));
  EXPECT_TRUE(std::ranges::equal(stage.meshes.at(0).normals, expected, {}, {}, with_y_up));
  provenance.parameters.normals = false;
  stage = read_usda(encoded(mesh, MeshFormat::kUsda, provenance));
  EXPECT_TRUE(stage.meshes.at(0).normals.empty());
}

TEST(Usd, SaysWhereItComesFrom) {
  Provenance provenance;
  provenance.samples = "abc";
  provenance.iso = 60.5;
  provenance.notes = {{"code", "a \"quoted\" \\ and\na line"}};
  const UsdStage stage =
      read_usda(encoded(test::meshes_to_encode().front().mesh, MeshFormat::kUsda, provenance));
  const auto json = nlohmann::json::parse(stage.provenance);
  EXPECT_EQ(json["samples"], "abc");
  EXPECT_EQ(json["iso"], 60.5);
  EXPECT_EQ(json["notes"][0]["detail"], provenance.notes[0].detail);
}

TEST(Usd, OfAnEmptySurfaceHasNoMesh) {
  EXPECT_TRUE(read_usda(encoded(mesh::Mesh{}, MeshFormat::kUsda)).meshes.empty());
}

TEST(Usdz, IsAPackageWithTheSameText) {
  const mesh::Mesh& mesh = test::large_mesh();
  const std::string package = encoded(mesh, MeshFormat::kUsdz);
  EXPECT_EQ(test::first_file_of_usdz(package), encoded(mesh, MeshFormat::kUsda));
  EXPECT_EQ(
      test::unzipped(package),
      (std::map<std::string, std::string>{{"isomesh.usda", encoded(mesh, MeshFormat::kUsda)}}));
}

class UsdOfLabels : public test::LabelFilesTest {};

TEST_F(UsdOfLabels, HasAMeshWithNameColourAndValueForEachLabel) {
  labels_[2].name = "7 \"of\" 9";
  labels_[3].name = "Left ventr\u00edculo";
  provenance_.parameters.normals = true;
  const UsdStage stage = read_usda(encoded(MeshFormat::kUsda));
  ASSERT_EQ(stage.meshes.size(), kLabels);
  std::vector<Places> places;
  for (std::size_t n = 0; n < kLabels; ++n) {
    const UsdMesh& mesh = stage.meshes[n];
    EXPECT_EQ(mesh.title, title_of(labels_[n]));
    EXPECT_EQ(mesh.label, labels_[n].label);
    EXPECT_EQ(mesh.points.size(), labels_[n].vertices);
    EXPECT_EQ(mesh.normals.size(), labels_[n].vertices);
    EXPECT_EQ(mesh.triangles.size(), labels_[n].triangles);
    EXPECT_EQ(mesh.color, mesh.material_color);
    Places& own = places.emplace_back();
    for (const Vec3& at : mesh.points) own.insert({at[0], -at[2], at[1]});
  }
  expect_shared(places);
  EXPECT_EQ(stage.meshes[0].prim, "label_1");
  EXPECT_EQ(stage.meshes[1].prim, "Left_ventr__culo");
  EXPECT_EQ(stage.meshes[2].prim, "_7__of__9");
  EXPECT_EQ(stage.meshes[3].prim, "Left_ventr__culo_4");
  // #ff8000 is 1, 0.216, 0 in linear light.
  EXPECT_EQ(stage.meshes[1].color[0], 1);
  EXPECT_NEAR(stage.meshes[1].color[1], 0.2159, 1e-4);
  EXPECT_EQ(stage.meshes[1].color[2], 0);
}

TEST_F(UsdOfLabels, NoMeshIsNamedLikeAMaterial) {
  labels_[0].name = "implant";
  labels_[1].name = "implant material";
  const UsdStage stage = read_usda(encoded(MeshFormat::kUsda));
  ASSERT_EQ(stage.meshes.size(), kLabels);
  EXPECT_EQ(stage.meshes[0].prim, "implant");
  EXPECT_EQ(stage.meshes[1].prim, "implant_material_2");
  EXPECT_EQ(stage.meshes[1].title, "implant material");
}

TEST_F(UsdOfLabels, IsTheSameInAPackage) {
  EXPECT_EQ(test::first_file_of_usdz(encoded(MeshFormat::kUsdz)), encoded(MeshFormat::kUsda));
}

}  // namespace
}  // namespace isomesh::codec
