#include "server/codec/encode.h"

#include <string>

#include <gtest/gtest.h>

#include "tests/support/errors.h"
#include "tests/unit/codec/meshes.h"

namespace isomesh::codec {
namespace {

// All formats of the contract.
constexpr std::array kFormats = {MeshFormat::kDrc, MeshFormat::kGlb, MeshFormat::kStl,
                                 MeshFormat::kPly, MeshFormat::kObj};

TEST(Encode, WritesTheFormatThatIsAsked) {
  const mesh::Mesh mesh = test::mesh_of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}});
  EXPECT_TRUE(test::encoded(mesh, MeshFormat::kDrc).starts_with("DRACO"));
  EXPECT_EQ(test::encoded(mesh, MeshFormat::kStl).size(), 84U + 50U);
}

TEST(Encode, RefusesExactlyWhatItCannot) {
  for (const MeshFormat format : kFormats) {
    SCOPED_TRACE(to_string(format));
    const auto code = test::code_thrown_by([&] { test::encoded(mesh::Mesh{}, format); });
    EXPECT_EQ(code.has_value(), !can_encode(format));
    if (code) {
      EXPECT_EQ(*code, ErrorCode::kInvalidParameter);
    }
  }
}

TEST(MediaType, IsTheRegisteredOne) {
  EXPECT_EQ(media_type(MeshFormat::kGlb), "model/gltf-binary");
  EXPECT_EQ(media_type(MeshFormat::kStl), "model/stl");
  EXPECT_EQ(media_type(MeshFormat::kObj), "model/obj");
  EXPECT_EQ(media_type(MeshFormat::kDrc), "application/octet-stream");
  EXPECT_EQ(media_type(MeshFormat::kPly), "application/octet-stream");
}

}  // namespace
}  // namespace isomesh::codec
