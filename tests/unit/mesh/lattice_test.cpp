#include "server/mesh/lattice/lattice.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/lattice/tetrahedra.h"
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

// The samples of even i+j+k are a face-centred cubic lattice: each has twelve nearest neighbours,
// at a distance of the square root of two. Space between them is filled by regular tetrahedra and
// regular octahedra (the tetrahedral-octahedral honeycomb).
using LatticePoint = std::array<int, 3>;
using Tetrahedron = std::array<LatticePoint, 4>;

bool is_even(const LatticePoint& point) { return (point[0] + point[1] + point[2]) % 2 == 0; }

int square_distance(const LatticePoint& a, const LatticePoint& b) {
  int square = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    square += (a[axis] - b[axis]) * (a[axis] - b[axis]);
  }
  return square;
}

// The tetrahedra of a block of cells that are split into five.
std::vector<Tetrahedron> five_way_block(int cells) {
  std::vector<Tetrahedron> all;
  for (int z = 0; z < cells; ++z) {
    for (int y = 0; y < cells; ++y) {
      for (int x = 0; x < cells; ++x) {
        const CellSplit& split = cell_split(Scheme::kFive, !is_even({x, y, z}));
        for (std::size_t t = 0; t < split.tetrahedra; ++t) {
          Tetrahedron& corners = all.emplace_back();
          for (std::size_t c = 0; c < 4; ++c) {
            const int corner = split.corners[t][c];
            corners[c] = {x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2)};
          }
        }
      }
    }
  }
  return all;
}

TEST(FiveWaySplit, JoinsEachEvenSampleToTheNearestOfTheFaceCentredLattice) {
  constexpr int kCells = 6;
  std::map<LatticePoint, std::set<LatticePoint>> neighbors;
  for (const Tetrahedron& corners : five_way_block(kCells)) {
    for (const LatticePoint& a : corners) {
      for (const LatticePoint& b : corners) {
        if (a != b && is_even(a) && is_even(b)) neighbors[a].insert(b);
      }
    }
  }
  for (const auto& [sample, others] : neighbors) {
    for (const LatticePoint& other : others) ASSERT_EQ(square_distance(sample, other), 2);
    const bool is_inner = std::ranges::all_of(sample, [](int at) { return at > 0 && at < kCells; });
    EXPECT_TRUE(!is_inner || others.size() == 12);
  }
}

TEST(FiveWaySplit, IsTetrahedraAndOctahedraCutIntoEightOfTheFaceCentredLattice) {
  constexpr int kCells = 6;
  std::map<LatticePoint, std::vector<Tetrahedron>> around_odd;
  std::size_t regular = 0;
  for (const Tetrahedron& corners : five_way_block(kCells)) {
    const auto odd = std::ranges::find_if_not(corners, is_even);
    if (odd != corners.end()) {
      ASSERT_EQ(std::ranges::count_if(corners, is_even), 3);
      around_odd[*odd].push_back(corners);
      continue;
    }
    ++regular;
    for (const LatticePoint& a : corners) {
      for (const LatticePoint& b : corners) ASSERT_EQ(square_distance(a, b), a == b ? 0 : 2);
    }
  }
  EXPECT_EQ(regular, std::size_t{kCells * kCells * kCells});  // one in the middle of each cell
  std::size_t octahedra = 0;
  for (const auto& [middle, tetrahedra] : around_odd) {
    if (!std::ranges::all_of(middle, [](int at) { return at > 0 && at < kCells; })) continue;
    ++octahedra;
    EXPECT_EQ(tetrahedra.size(), 8U);
    std::set<LatticePoint> corners;
    for (const Tetrahedron& tetrahedron : tetrahedra) {
      for (const LatticePoint& corner : tetrahedron) {
        if (corner == middle) continue;
        EXPECT_EQ(square_distance(corner, middle), 1);
        corners.insert(corner);
      }
    }
    EXPECT_EQ(corners.size(), 6U);
  }
  EXPECT_EQ(octahedra, 63U);  // of the 125 inner samples
}

}  // namespace
}  // namespace isomesh::mesh
