// 3MF files of one surface, as the 3MF Consortium's library reads them.
#include <algorithm>
#include <cstring>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "server/codec/formats.h"
#include "server/codec/mesher_version.h"
#include "tests/unit/codec/foreign_3mf.h"
#include "tests/unit/codec/meshes.h"

namespace isomesh::codec {
namespace {

using test::encoded;
using test::Model3mf;
using test::read_with_lib3mf;

TEST(ThreeMf, HoldsTheSameVerticesAndTrianglesInMillimetres) {
  for (const auto& [name, mesh] : test::meshes_to_encode()) {
    SCOPED_TRACE(name);
    const Model3mf model = read_with_lib3mf(encoded(mesh, MeshFormat::k3mf));
    EXPECT_TRUE(model.is_in_millimetres);
    ASSERT_EQ(model.objects.size(), 1U);
    EXPECT_TRUE(std::ranges::equal(model.objects[0].points, mesh.positions));
    EXPECT_TRUE(std::ranges::equal(model.objects[0].triangles, mesh.triangles));
  }
}

// Slicers reject a file with an object of another type.
TEST(ThreeMf, IsAModelAlsoIfItIsOpen) {
  for (const auto& [name, mesh] : test::meshes_to_encode()) {
    SCOPED_TRACE(name);
    const Model3mf model = read_with_lib3mf(encoded(mesh, MeshFormat::k3mf));
    EXPECT_EQ(model.items, 1U);
    EXPECT_TRUE(model.objects.at(0).is_model);
    EXPECT_EQ(model.objects[0].color, std::nullopt);
  }
}

TEST(ThreeMf, IsNamedAfterTheIsoValue) {
  Provenance provenance;
  provenance.iso = -823.25;
  const Model3mf model = read_with_lib3mf(
      encoded(test::meshes_to_encode().front().mesh, MeshFormat::k3mf, provenance));
  EXPECT_EQ(model.objects.at(0).name, "iso -823.25");
  EXPECT_EQ(model.metadata.at("Title"), "iso -823.25");
  EXPECT_EQ(model.metadata.at("Description"),
            "The surface at the value -823.25. Coordinates in LPS, in millimetres.");
}

TEST(ThreeMf, DescribesSpaceUnitAndLimit) {
  Provenance provenance;
  provenance.iso = 60;
  provenance.parameters.space = Space::kRas;
  provenance.parameters.max_error_mm = 0.1;
  provenance.notes = {{"unit-angstrom", ""}};
  const Model3mf model = read_with_lib3mf(
      encoded(test::meshes_to_encode().front().mesh, MeshFormat::k3mf, provenance));
  EXPECT_EQ(model.metadata.at("Description"),
            "The surface at the value 60. Coordinates in RAS, in angstrom, written as millimetres. "
            "Requested largest error: 0.1 angstrom.");
}

TEST(ThreeMf, SaysWhereItComesFrom) {
  Provenance provenance;
  provenance.samples = "abc";
  provenance.parameters.passes = 9;
  provenance.iso = 60.5;
  provenance.notes = {{"code", "Less than < & \"quotes\""}};
  const Model3mf model = read_with_lib3mf(
      encoded(test::meshes_to_encode().front().mesh, MeshFormat::k3mf, provenance));
  EXPECT_EQ(model.metadata.at("Application"), std::string("isomesh, mesher ") + kMesherVersion);
  std::string text;
  for (const auto& [key, value] : model.metadata) {
    if (key.ends_with("provenance")) text = value;
  }
  const auto json = nlohmann::json::parse(text);
  EXPECT_EQ(json["samples"], "abc");
  EXPECT_EQ(json["parameters"]["passes"], 9);
  EXPECT_EQ(json["iso"], 60.5);
  EXPECT_EQ(json["notes"][0]["detail"], "Less than < & \"quotes\"");
}

TEST(ThreeMf, OfAnEmptySurfaceHasNoObject) {
  const Model3mf model = read_with_lib3mf(encoded(mesh::Mesh{}, MeshFormat::k3mf));
  EXPECT_TRUE(model.is_in_millimetres);
  EXPECT_TRUE(model.objects.empty());
}

TEST(ThreeMf, DoesNotDependOnTheTime) {
  // The ZIP entry has the earliest time that ZIP can represent.
  const std::string file = encoded(test::meshes_to_encode().front().mesh, MeshFormat::k3mf);
  std::uint32_t time = 0;
  std::memcpy(&time, file.data() + 10, sizeof time);
  EXPECT_EQ(time, 0x00210000U) << "midnight of January 1st, 1980";
}

}  // namespace
}  // namespace isomesh::codec
