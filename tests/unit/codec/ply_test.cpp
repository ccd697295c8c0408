#include <cstring>
#include <string>

#include <gtest/gtest.h>

#include "server/codec/encode.h"
#include "tests/unit/codec/meshes.h"

namespace isomesh::codec {
namespace {

using test::encoded;

constexpr std::size_t kVertexBytes = 12;
constexpr std::size_t kFaceBytes = 13;

TEST(Ply, SaysHowManyVerticesAndFacesFollowAndInWhatUnit) {
  const mesh::Mesh mesh =
      test::mesh_of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 2, 1}, {0, 1, 3}});
  const std::string ply = encoded(mesh, MeshFormat::kPly);
  const std::string header =
      "ply\nformat binary_little_endian 1.0\ncomment isomesh, millimetres, SPACE=LPS\n"
      "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 2\nproperty list uchar uint vertex_indices\nend_header\n";
  ASSERT_TRUE(ply.starts_with(header)) << ply.substr(0, header.size());
  ASSERT_EQ(ply.size(), header.size() + 4 * kVertexBytes + 2 * kFaceBytes);
  EXPECT_EQ(std::memcmp(ply.data() + header.size(), mesh.positions.data(), 4 * kVertexBytes), 0);
  const char* const face = ply.data() + header.size() + 4 * kVertexBytes + kFaceBytes;
  EXPECT_EQ(*face, 3);
  EXPECT_EQ(std::memcmp(face + 1, &mesh.triangles[1], sizeof(mesh::Triangle)), 0);
}

TEST(Ply, OfAnEmptyMeshIsAHeaderOnly) {
  const std::string ply = encoded(mesh::Mesh{}, MeshFormat::kPly);
  EXPECT_NE(ply.find("element vertex 0\n"), std::string::npos);
  EXPECT_TRUE(ply.ends_with("end_header\n"));
}

}  // namespace
}  // namespace isomesh::codec
