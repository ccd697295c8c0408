#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "server/codec/encode.h"
#include "tests/unit/codec/meshes.h"

namespace isomesh::codec {
namespace {

using test::encoded;

constexpr std::size_t kHeaderBytes = 80;
constexpr std::size_t kFacetBytes = 50;

template <class T>
T value_at(const std::string& bytes, std::size_t offset) {
  T value;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

// A facet's normal and corners as they stand in the file.
std::array<mesh::Vec3, 4> facet(const std::string& stl, std::size_t index) {
  return value_at<std::array<mesh::Vec3, 4>>(stl, kHeaderBytes + 4 + index * kFacetBytes);
}

mesh::Mesh tetrahedron() {
  return test::mesh_of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                       {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}});
}

TEST(Stl, IsAHeaderACountAndFacetsOfFiftyBytes) {
  const mesh::Mesh mesh = tetrahedron();
  const std::string stl = encoded(mesh, MeshFormat::kStl);
  ASSERT_EQ(stl.size(), kHeaderBytes + 4 + 4 * kFacetBytes);
  EXPECT_EQ(value_at<std::uint32_t>(stl, kHeaderBytes), 4U);
  for (std::size_t t = 0; t < 4; ++t) {
    const auto [normal, a, b, c] = facet(stl, t);
    EXPECT_EQ(a, mesh.positions[mesh.triangles[t][0]]);
    EXPECT_EQ(b, mesh.positions[mesh.triangles[t][1]]);
    EXPECT_EQ(c, mesh.positions[mesh.triangles[t][2]]);
    EXPECT_EQ(value_at<std::uint16_t>(stl, kHeaderBytes + 4 + (t + 1) * kFacetBytes - 2), 0);
  }
}

TEST(Stl, IsNotTakenForText) {
  const std::string stl = encoded(tetrahedron(), MeshFormat::kStl);
  EXPECT_FALSE(stl.starts_with("solid"));
  EXPECT_EQ(stl.substr(0, kHeaderBytes).find_first_of("\r\n"), std::string::npos);
}

TEST(Stl, NormalsAreUnitVectorsOutOfTheSolid) {
  const std::string stl = encoded(tetrahedron(), MeshFormat::kStl);
  const float third = 1 / std::sqrt(3.0F);
  const std::vector<mesh::Vec3> expected = {
      {0, 0, -1}, {0, -1, 0}, {-1, 0, 0}, {third, third, third}};
  for (std::size_t t = 0; t < expected.size(); ++t) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      EXPECT_FLOAT_EQ(facet(stl, t)[0][axis], expected[t][axis]);
    }
  }
}

TEST(Stl, NormalsOfSmallTrianglesFarAwayAreStillUnitVectors) {
  const std::string stl =
      encoded(test::mesh_of({{1000, 1000, 1000}, {1000.001F, 1000, 1000}, {1000, 1000.001F, 1000}},
                            {{0, 1, 2}}),
              MeshFormat::kStl);
  EXPECT_EQ(facet(stl, 0)[0], (mesh::Vec3{0, 0, 1}));
}

TEST(Stl, ATriangleWithoutAreaHasNoNormal) {
  const std::string stl =
      encoded(test::mesh_of({{0, 0, 0}, {1, 1, 1}, {2, 2, 2}}, {{0, 1, 2}}), MeshFormat::kStl);
  EXPECT_EQ(facet(stl, 0)[0], (mesh::Vec3{0, 0, 0}));
}

TEST(Stl, AnEmptyMeshIsAHeaderOnly) {
  const std::string stl = encoded(mesh::Mesh{}, MeshFormat::kStl);
  ASSERT_EQ(stl.size(), kHeaderBytes + 4);
  EXPECT_EQ(value_at<std::uint32_t>(stl, kHeaderBytes), 0U);
}

}  // namespace
}  // namespace isomesh::codec
