// Every format, read by readers that are not ours: the same triangles in the same place.
#include "tests/unit/codec/foreign.h"

#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "server/codec/encode.h"
#include "server/mesh/measure/normals.h"
#include "tests/unit/codec/meshes.h"
#include "tests/unit/codec/same_mesh.h"

namespace isomesh::codec {
namespace {

using test::encoded;

// Sequences of triangles in one order. assimp reads text with an error of its own.
void expect_same_triangles(const std::vector<std::array<mesh::Vec3, 3>>& read,
                           const mesh::Mesh& mesh) {
  constexpr float kRelative = 1e-6F;
  ASSERT_EQ(read.size(), mesh.triangles.size());
  for (std::size_t t = 0; t < read.size(); ++t) {
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const mesh::Vec3& expected = mesh.positions[mesh.triangles[t][corner]];
      for (std::size_t axis = 0; axis < 3; ++axis) {
        ASSERT_NEAR(read[t][corner][axis], expected[axis], kRelative * std::abs(expected[axis]))
            << "triangle " << t;
      }
    }
  }
}

// The text formats by a second reader; foreign_exact_test.cpp has a first one for each.
class ForeignReader : public testing::TestWithParam<MeshFormat> {};

TEST_P(ForeignReader, FindsEveryTriangleInItsPlace) {
  const std::string suffix(to_string(GetParam()));
  for (const auto& [name, mesh] : test::meshes_to_encode()) {
    SCOPED_TRACE(name);
    expect_same_triangles(test::read_with_assimp(encoded(mesh, GetParam()), suffix), mesh);
  }
  expect_same_triangles(test::read_with_assimp(encoded(test::large_mesh(), GetParam()), suffix),
                        test::large_mesh());
}

INSTANTIATE_TEST_SUITE_P(Formats, ForeignReader,
                         testing::Values(MeshFormat::kObj, MeshFormat::k3mf, MeshFormat::kOff),
                         [](const auto& test) { return std::string(to_string(test.param)); });

TEST(ForeignGlbReader, FindsEveryTriangleInItsPlaceAndNoFault) {
  for (const auto& [name, mesh] : test::meshes_to_encode()) {
    if (name.starts_with("flat") || name == "oblique") continue;  // node takes its time to start
    SCOPED_TRACE(name);
    std::vector<test::DecodedMesh> parts;
    for (auto& primitive : test::read_with_node(encoded(mesh, MeshFormat::kGlb))) {
      EXPECT_EQ(primitive.normals.size(), primitive.mesh.points.size());
      parts.push_back(std::move(primitive.mesh));
    }
    test::expect_same_mesh(test::welded(parts), mesh, DracoParameters{}.position_bits);
  }
}

TEST(ForeignGlbReader, FindsNormalsThatAreTheSameOnBothSidesOfASeam) {
  const mesh::Mesh mesh = test::several_blocks();
  mesh::Buffer<mesh::Vec3> normals;
  vertex_normals(mesh, {}, normals);
  Provenance provenance;
  provenance.parameters.normals = true;
  provenance.parameters.draco.position_bits = 16;
  const auto primitives = test::read_with_node(encoded(mesh, MeshFormat::kGlb, provenance));
  ASSERT_GT(primitives.size(), 2U);
  std::map<mesh::Vec3, mesh::Vec3> found;
  std::size_t on_seams = 0;
  for (const auto& [part, part_normals, part_distances] : primitives) {
    ASSERT_EQ(part_normals.size(), part.points.size());
    EXPECT_TRUE(part_distances.empty());
    for (std::size_t v = 0; v < part.points.size(); ++v) {
      const auto [at, is_new] = found.emplace(part.points[v], part_normals[v]);
      if (is_new) continue;
      ++on_seams;
      EXPECT_EQ(at->second, part_normals[v]) << "normals differ across a seam";
    }
  }
  EXPECT_GT(on_seams, 100U);
  EXPECT_EQ(found.size(), mesh.positions.size());
  // The normals of a sphere run from its centre; the steps of midpoints tilt single ones far.
  double cosines = 0;
  for (const auto& [at, normal] : found) {
    const std::array<double, 3> out = {at[0] - 60.0, at[1] - 60.0, at[2] - 60.0};
    cosines += (out[0] * normal[0] + out[1] * normal[1] + out[2] * normal[2]) /
               std::hypot(out[0], out[1], out[2]);
  }
  EXPECT_GT(cosines / static_cast<double>(found.size()), 0.8);
}

TEST(ForeignGlbReader, TakesAnEmptyMesh) {
  EXPECT_TRUE(test::read_with_node(encoded(mesh::Mesh{}, MeshFormat::kGlb)).empty());
}

}  // namespace
}  // namespace isomesh::codec
