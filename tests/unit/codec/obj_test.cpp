#include <cstdlib>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "server/codec/encode.h"
#include "tests/unit/codec/meshes.h"

namespace isomesh::codec {
namespace {

using test::encoded;

TEST(Obj, IsAVertexOrAFaceALine) {
  const mesh::Mesh mesh =
      test::mesh_of({{0, 0.5F, -1}, {1e6F, 0, 0}, {0, 1.25F, 0}}, {{0, 2, 1}, {2, 0, 1}});
  EXPECT_EQ(encoded(mesh, MeshFormat::kObj),
            "# isomesh, millimetres, SPACE=LPS\nv 0 0.5 -1\nv 1000000 0 0\nv 0 1.25 0\nf 1 3 2\nf "
            "3 1 2\n");
}

TEST(Obj, CoordinatesReadAsTheSameFloatsAndHaveNoExponent) {
  using Limits = std::numeric_limits<float>;
  const std::vector<mesh::Vec3> positions = {
      {0.1F, 1.0F / 3, -123.456F},
      {Limits::max(), Limits::lowest(), Limits::min()},
      {-Limits::denorm_min(), 16777218, 1 + Limits::epsilon()}};
  const std::string obj = encoded(test::mesh_of(positions, {{0, 1, 2}}), MeshFormat::kObj);
  std::istringstream lines(obj);
  std::string line;
  std::getline(lines, line);
  for (const mesh::Vec3& position : positions) {
    std::getline(lines, line);
    EXPECT_EQ(line.find_first_of("eE"), std::string::npos) << line;
    const char* next = line.c_str() + 1;
    for (const float coordinate : position) {
      char* end = nullptr;
      EXPECT_EQ(std::strtof(next, &end), coordinate) << line;
      next = end;
    }
  }
}

}  // namespace
}  // namespace isomesh::codec
