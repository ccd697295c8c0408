// 3MF files of one surface, as the 3MF Consortium's library reads them.
#include <algorithm>
#include <cstring>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "server/codec/formats.h"
#include "server/mesh/topology/topology.h"
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

TEST(ThreeMf, IsAModelToPrintOnlyIfItEnclosesSomething) {
  for (const auto& [name, mesh] : test::meshes_to_encode()) {
    SCOPED_TRACE(name);
    const bool is_closed = measure_topology(mesh, {}).boundary_edges == 0;
    EXPECT_EQ(is_closed, name != "open" && !name.starts_with("flat") && name != "triangle" &&
                             name != "two apart");
    const Model3mf model = read_with_lib3mf(encoded(mesh, MeshFormat::k3mf));
    EXPECT_EQ(model.objects.at(0).is_model, is_closed);
  }
}

TEST(ThreeMf, TellsTheTopologyThatItMeasures) {
  const mesh::Mesh mesh = test::several_blocks();
  const auto topology = encode(mesh, MeshFormat::k3mf, {}, {}, [](auto) {});
  ASSERT_TRUE(topology.has_value());
  EXPECT_EQ(*topology, measure_topology(mesh, {}));
  EXPECT_TRUE(describe(MeshFormat::k3mf).shows_topology({}));
}

TEST(ThreeMf, SaysWhereItComesFrom) {
  Provenance provenance;
  provenance.samples = "abc";
  provenance.parameters.passes = 9;
  provenance.iso = 60.5;
  provenance.notes = {{"code", "Less than < & \"quotes\""}};
  const Model3mf model = read_with_lib3mf(
      encoded(test::meshes_to_encode().front().mesh, MeshFormat::k3mf, provenance));
  EXPECT_EQ(model.metadata.at("Title"), "surface");
  EXPECT_EQ(model.metadata.at("Application"), "isomesh");
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
