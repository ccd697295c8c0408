#include "server/mesh/lattice/lattice.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "tests/support/shapes.h"

namespace isomesh::mesh {
namespace {

class LatticeToSpaceOf : public testing::TestWithParam<test::NamedGeometry> {};

TEST_P(LatticeToSpaceOf, IsOriginPlusDirectionTimesSpacing) {
  const LatticeToSpace expected = test::space_of(GetParam().geometry);
  const LatticeToSpace map = lattice_to_space(GetParam().geometry);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_DOUBLE_EQ(map.origin[axis], expected.origin[axis]);
    EXPECT_DOUBLE_EQ(map.step_x[axis], expected.step_x[axis]);
    EXPECT_DOUBLE_EQ(map.step_y[axis], expected.step_y[axis]);
    EXPECT_DOUBLE_EQ(map.step_z[axis], expected.step_z[axis]);
  }
}

TEST_P(LatticeToSpaceOf, HasTheVolumeOfACellAsDeterminant) {
  const auto& [x, y, z] = GetParam().geometry.spacing;
  const bool left_handed = GetParam().name.find("left_handed") != std::string::npos;
  const double shear = GetParam().name == "tilted" ? std::cos(20 * std::numbers::pi / 180) : 1;
  EXPECT_NEAR(lattice_to_space(GetParam().geometry).determinant(),
              (left_handed ? -1 : 1) * x * y * z * shear, 1e-12);
}

INSTANTIATE_TEST_SUITE_P(Geometries, LatticeToSpaceOf, testing::ValuesIn(test::all_geometries()),
                         [](const auto& test) { return test.param.name; });

TEST(Dims, HasCellsOnlyWithTwoSamplesAlongEveryAxis) {
  EXPECT_TRUE((Dims{2, 2, 2}.has_cells()));
  EXPECT_FALSE((Dims{1, 2, 2}.has_cells()));
  EXPECT_FALSE((Dims{2, 1, 2}.has_cells()));
  EXPECT_FALSE((Dims{2, 2, 1}.has_cells()));
  EXPECT_FALSE((Dims{0, 0, 0}.has_cells()));
}

TEST(Dims, CountsMoreSamplesThan32BitsHold) {
  EXPECT_EQ((Dims{4096, 4096, 4096}.samples()), std::uint64_t{1} << 36);
}

}  // namespace
}  // namespace isomesh::mesh
