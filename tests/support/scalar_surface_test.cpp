// The reference by hand, and the comparison with it, which must detect every kind of difference.
#include "tests/support/scalar_surface.h"

#include <algorithm>
#include <functional>
#include <string>

#include <gtest/gtest.h>

#include "tests/support/kernels.h"
#include "tests/support/shapes.h"

namespace isomesh::test {
namespace {

constexpr mesh::ExtractOptions kOptions = {0, Scheme::kSix, Interpolation::kLinear};

struct Change {
  std::string name;
  std::function<void(mesh::Mesh&)> make;
};

class Matches : public testing::TestWithParam<Change> {
 protected:
  SampleVolume<double> samples = noise<double>({-9, -2, 1, 5}, {6, 5, 4}, 1);
  ScalarSurface expected = scalar_surface(samples.lattice(), kOptions);
  mesh::Mesh copy = extracted(samples, kOptions);
};

TEST_P(Matches, NotAfter) {
  ASSERT_TRUE(matches(copy, expected));
  GetParam().make(copy);
  EXPECT_FALSE(matches(copy, expected));
}

INSTANTIATE_TEST_SUITE_P(
    Changes, Matches,
    testing::Values(
        Change{"AVertexMoves", [](mesh::Mesh& mesh) { mesh.positions[7][0] += 1e-4F; }},
        Change{"VerticesAreExchanged",
               [](mesh::Mesh& mesh) { std::swap(mesh.positions[7], mesh.positions[8]); }},
        Change{"ATriangleTurns",
               [](mesh::Mesh& mesh) { std::swap(mesh.triangles[5][0], mesh.triangles[5][1]); }},
        Change{"ATriangleIsThereTwice",
               [](mesh::Mesh& mesh) { mesh.triangles[5] = mesh.triangles[6]; }},
        Change{"VerticesAreInAnotherLayer", [](mesh::Mesh& mesh) { ++mesh.layer_vertices[2]; }},
        Change{"TrianglesAreInAnotherLayer", [](mesh::Mesh& mesh) { --mesh.layer_triangles[2]; }}),
    [](const auto& test) { return test.param.name; });

TEST_F(Matches, NotAnotherSchemeOrInterpolation) {
  const auto of = [&](Scheme scheme, Interpolation way) {
    return scalar_surface(samples.lattice(), {0, scheme, way});
  };
  EXPECT_FALSE(matches(copy, of(Scheme::kFive, Interpolation::kLinear)));
  EXPECT_FALSE(matches(copy, of(Scheme::kBcc, Interpolation::kLinear)));
  EXPECT_FALSE(matches(copy, of(Scheme::kSix, Interpolation::kMidpoint)));
}

// Derived by hand: corner 0 of one cell is inside. In the five-way split it is in four tetrahedra,
// crossed on three edges and three face diagonals; in the six-way split in all six, and also on the
// cell's diagonal. On the body-centred lattice, it is in the six tetrahedra of three faces, crossed
// on three edges and three face diagonals, and on the one to the centre.
TEST(ScalarSurface, OfOneCorner) {
  auto corner = constant<double>(0, {2, 2, 2});
  corner.samples[0] = 4;
  const auto of = [&](Scheme scheme) {
    return scalar_surface(corner.lattice(), {1, scheme, Interpolation::kLinear});
  };
  EXPECT_EQ(of(Scheme::kFive).vertices.size(), 6U);
  EXPECT_EQ(of(Scheme::kFive).triangles.size(), 4U);
  EXPECT_EQ(of(Scheme::kSix).vertices.size(), 7U);
  EXPECT_EQ(of(Scheme::kSix).triangles.size(), 6U);
  EXPECT_EQ(of(Scheme::kBcc).vertices.size(), 7U);
  EXPECT_EQ(of(Scheme::kBcc).triangles.size(), 6U);
  for (const ScalarVertex& vertex : of(Scheme::kSix).vertices) {
    EXPECT_EQ(vertex.crossings.front().share, 0.75);
  }
  // The outside is opposite of the corner.
  for (const Scheme scheme : {Scheme::kFive, Scheme::kSix, Scheme::kBcc}) {
    EXPECT_GT(extent_of(of(scheme).surface()).volume, 0);
  }
}

// The second cell along x is odd, so mirrored: the sample at its corner 1 is in four tetrahedra,
// like corner 0 of an even cell, and the sample at its corner 2 is the tip of a single tetrahedron.
TEST(ScalarSurface, OfOneCornerOfAMirroredCell) {
  const mesh::ExtractOptions five = {1, Scheme::kFive, Interpolation::kLinear};
  auto shared = constant<double>(0, {3, 2, 2});
  shared.at(2, 0, 0) = 4;
  EXPECT_EQ(scalar_surface(shared.lattice(), five).vertices.size(), 6U);
  auto tip = constant<double>(0, {3, 2, 2});
  tip.at(2, 1, 0) = 4;
  EXPECT_EQ(scalar_surface(tip.lattice(), five).vertices.size(), 3U);
}

// All crossings are nearest to the only inside sample. Joined to one vertex they would vanish.
TEST(ScalarSurface, JoinsNoWholeLink) {
  auto dot = constant<double>(0, {3, 3, 3});
  dot.at(1, 1, 1) = 1;
  const mesh::ExtractOptions plain = {0.9, Scheme::kSix, Interpolation::kLinear};
  mesh::ExtractOptions regular = plain;
  regular.regularize = true;
  EXPECT_EQ(scalar_surface(dot.lattice(), plain).vertices.size(), 14U);
  EXPECT_EQ(scalar_surface(dot.lattice(), regular).vertices.size(), 14U);
}

}  // namespace
}  // namespace isomesh::test
