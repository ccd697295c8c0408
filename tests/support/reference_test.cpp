// The comparison must detect every kind of difference from the reference.
#include "tests/support/reference.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "tests/support/shapes.h"

namespace isomesh::test {
namespace {

constexpr mesh::ExtractOptions kOptions = {0, Scheme::kSix, Interpolation::kLinear};

SampleVolume<std::int16_t> noisy_samples() {
  return noise<std::int16_t>({-9, -2, 1, 5}, {6, 5, 4}, 1);
}

// A mesh from the reference in the form of the kernels.
mesh::Mesh mesh_of(const ReferenceMesh& reference) {
  const Surface surface = reference.surface();
  std::vector<std::uint32_t> order(surface.points.size());
  for (std::uint32_t v = 0; v < order.size(); ++v) order[v] = v;
  const auto plane = [&](std::uint32_t v) {
    return std::min(reference.vertices[v].inside[2], reference.vertices[v].outside[2]);
  };
  std::stable_sort(order.begin(), order.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return plane(a) < plane(b); });

  mesh::Mesh result;
  std::vector<std::uint32_t> numbers(order.size());
  result.positions.resize_for_overwrite(order.size());
  result.layer_vertices.assign(reference.dims.z + 1, 0);
  for (std::uint32_t n = 0; n < order.size(); ++n) {
    numbers[order[n]] = n;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      result.positions[n][axis] = static_cast<float>(surface.points[order[n]][axis]);
    }
    ++result.layer_vertices[plane(order[n]) + 1];
  }
  result.triangles.resize_for_overwrite(surface.triangles.size());
  for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
    const auto& [a, b, c] = surface.triangles[t];
    result.triangles[t] = {numbers[a], numbers[b], numbers[c]};
  }
  result.layer_triangles.assign(reference.dims.z + 1, 0);
  for (const ReferencePatch& patch : reference.patches) {
    result.layer_triangles[patch.layer + 1] += patch.corners.size() - 2;
  }
  for (std::size_t k = 0; k < reference.dims.z; ++k) {
    result.layer_vertices[k + 1] += result.layer_vertices[k];
    result.layer_triangles[k + 1] += result.layer_triangles[k];
  }
  return result;
}

class Matches : public testing::Test {
 protected:
  SampleVolume<std::int16_t> samples = noisy_samples();
  ReferenceMesh expected = reference_surface(samples.lattice(), kOptions);
  mesh::Mesh copy = mesh_of(expected);
};

TEST_F(Matches, AcceptsTheReferenceItself) {
  EXPECT_TRUE(matches(copy, expected));
  EXPECT_TRUE(is_sound(surface_of(copy)));
}

TEST_F(Matches, AcceptsTheOtherDiagonal) {
  std::size_t triangle = 0;
  for (const ReferencePatch& patch : expected.patches) {
    if (patch.corners.size() == 4) {
      const auto [a, b, c] = copy.triangles[triangle];
      const std::uint32_t d = copy.triangles[triangle + 1][2];
      copy.triangles[triangle] = {a, b, d};
      copy.triangles[triangle + 1] = {b, c, d};
    }
    triangle += patch.corners.size() - 2;
  }
  EXPECT_TRUE(matches(copy, expected));
}

TEST_F(Matches, RefusesAMovedVertex) {
  copy.positions[7][0] += 1e-4F;
  EXPECT_FALSE(matches(copy, expected));
}

TEST_F(Matches, RefusesExchangedVertices) {
  std::swap(copy.positions[7], copy.positions[8]);
  EXPECT_FALSE(matches(copy, expected));
}

TEST_F(Matches, RefusesATurnedTriangle) {
  std::swap(copy.triangles[5][0], copy.triangles[5][1]);
  EXPECT_FALSE(matches(copy, expected));
}

TEST_F(Matches, RefusesATriangleThatIsThereTwice) {
  copy.triangles[5] = copy.triangles[6];
  EXPECT_FALSE(matches(copy, expected));
}

TEST_F(Matches, RefusesVerticesInAnotherLayer) {
  ++copy.layer_vertices[2];
  EXPECT_FALSE(matches(copy, expected));
}

TEST_F(Matches, RefusesTrianglesInAnotherLayer) {
  --copy.layer_triangles[2];
  EXPECT_FALSE(matches(copy, expected));
}

TEST_F(Matches, RefusesTheOtherScheme) {
  const mesh::ExtractOptions five = {0, Scheme::kFive, Interpolation::kLinear};
  EXPECT_FALSE(matches(copy, reference_surface(samples.lattice(), five)));
}

TEST_F(Matches, RefusesTheOtherInterpolation) {
  const mesh::ExtractOptions midpoint = {0, Scheme::kSix, Interpolation::kMidpoint};
  EXPECT_FALSE(matches(copy, reference_surface(samples.lattice(), midpoint)));
}

// Derived by hand: corner 0 of one cell is inside. In the five-way split it is in four tetrahedra,
// crossed on three edges and three face diagonals; in the six-way split in all six, and also on the
// cell's diagonal.
TEST(ReferenceSurface, OfOneCorner) {
  auto corner = constant<std::uint8_t>(0, {2, 2, 2});
  corner.samples[0] = 4;
  const auto five = reference_surface(corner.lattice(), {1, Scheme::kFive, Interpolation::kLinear});
  EXPECT_EQ(five.vertices.size(), 6U);
  EXPECT_EQ(five.triangles(), 4U);
  const auto six = reference_surface(corner.lattice(), {1, Scheme::kSix, Interpolation::kLinear});
  EXPECT_EQ(six.vertices.size(), 7U);
  EXPECT_EQ(six.triangles(), 6U);
  for (const ReferenceVertex& vertex : six.vertices) EXPECT_EQ(vertex.fraction, 0.75);
  // The outside is opposite of the corner.
  EXPECT_GT(extent_of(six.surface()).volume, 0);
  EXPECT_GT(extent_of(five.surface()).volume, 0);
}

// The second cell along x is odd, so mirrored: the sample at its corner 1 is in four tetrahedra,
// like corner 0 of an even cell, and the sample at its corner 2 is the tip of a single tetrahedron.
TEST(ReferenceSurface, OfOneCornerOfAMirroredCell) {
  const mesh::ExtractOptions five = {1, Scheme::kFive, Interpolation::kLinear};
  auto shared = constant<std::uint8_t>(0, {3, 2, 2});
  shared.at(2, 0, 0) = 4;
  EXPECT_EQ(reference_surface(shared.lattice(), five).vertices.size(), 6U);
  auto tip = constant<std::uint8_t>(0, {3, 2, 2});
  tip.at(2, 1, 0) = 4;
  EXPECT_EQ(reference_surface(tip.lattice(), five).vertices.size(), 3U);
}

}  // namespace
}  // namespace isomesh::test
