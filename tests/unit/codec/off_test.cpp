#include <string>

#include <gtest/gtest.h>

#include "server/codec/encode.h"
#include "tests/unit/codec/meshes.h"

namespace isomesh::codec {
namespace {

using test::encoded;

// NiiVue, gmsh, meshio and trimesh misread a file with a comment before its last face.
TEST(Off, TellsUnitAndSpaceAtItsEnd) {
  const mesh::Mesh mesh =
      test::mesh_of({{0, 0.5F, -1}, {1e6F, 0, 0}, {0, 1.25F, 0}}, {{0, 2, 1}, {2, 0, 1}});
  EXPECT_EQ(encoded(mesh, MeshFormat::kOff),
            "OFF\n3 2 0\n0 0.5 -1\n1000000 0 0\n0 1.25 0\n3 0 2 1\n3 2 0 1\n"
            "# isomesh, millimetres, SPACE=LPS\n");
  EXPECT_EQ(encoded(mesh::Mesh{}, MeshFormat::kOff),
            "OFF\n0 0 0\n# isomesh, millimetres, SPACE=LPS\n");
}

}  // namespace
}  // namespace isomesh::codec
