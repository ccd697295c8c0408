// Tests of the checks themselves: they must detect errors.
#include "tests/support/mesh_checks.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace isomesh::test {
namespace {

using testing::HasSubstr;

// A cube's corner, cut off at 1, 2 and 3: six times its volume is 6.
Surface tetrahedron() {
  return {{{0, 0, 0}, {1, 0, 0}, {0, 2, 0}, {0, 0, 3}},
          {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}};
}

void append(Surface& surface, const Surface& other, double shift) {
  const auto first = static_cast<std::uint32_t>(surface.points.size());
  for (const auto& [x, y, z] : other.points) surface.points.push_back({x + shift, y, z});
  for (const auto& [a, b, c] : other.triangles) {
    surface.triangles.push_back({first + a, first + b, first + c});
  }
}

void expect_flaw(const Surface& surface, const std::string& flaw) {
  const testing::AssertionResult result = is_sound(surface);
  EXPECT_FALSE(result);
  EXPECT_THAT(result.message(), HasSubstr(flaw));
}

TEST(ExtentOf, ATetrahedron) {
  const ExtentFacts facts = extent_of(tetrahedron());
  EXPECT_DOUBLE_EQ(facts.volume, 1);
  EXPECT_DOUBLE_EQ(facts.area, 1 + 1.5 + 3 + 3.5);
  EXPECT_DOUBLE_EQ(facts.smallest_area, 1);
  EXPECT_EQ(facts.high, (Point{1, 2, 3}));
  EXPECT_DOUBLE_EQ(extent_of(tetrahedron(), {5, -6, 7}).volume, 1);
}

TEST(TopologyOf, ClosedAndOpenSurfaces) {
  Surface surface = tetrahedron();
  append(surface, tetrahedron(), 5);
  TopologyFacts facts = topology_of(surface);
  EXPECT_EQ(facts.edges, 12U);
  EXPECT_EQ(facts.components, 2U);
  EXPECT_EQ(facts.euler, 4);
  EXPECT_EQ(facts.genus(), 0);
  EXPECT_TRUE(facts.boundary_edges.empty());

  surface.triangles.pop_back();
  facts = topology_of(surface);
  EXPECT_EQ(facts.boundary_edges.size(), 3U);
  EXPECT_EQ(facts.boundary_loops, 1U);
  EXPECT_EQ(facts.euler, 3);
  EXPECT_EQ(facts.genus(), 0);
}

TEST(IsSound, AcceptsClosedOpenAndEmptySurfaces) {
  Surface surface = tetrahedron();
  EXPECT_TRUE(is_sound(surface));
  surface.triangles.pop_back();
  EXPECT_TRUE(is_sound(surface));
  EXPECT_TRUE(is_sound({}));
}

TEST(IsSound, FindsEveryFlaw) {
  Surface surface = tetrahedron();
  std::swap(surface.triangles[0][0], surface.triangles[0][1]);
  expect_flaw(surface, "3 edges whose triangles are wound against each other");

  surface = tetrahedron();
  surface.points.push_back({-1, -1, -1});
  expect_flaw(surface, "1 vertices without a triangle");
  surface.triangles.push_back({0, 1, 4});
  expect_flaw(surface, "1 edges of more than two triangles");

  surface = tetrahedron();
  surface.triangles.push_back({0, 0, 1});
  expect_flaw(surface, "1 triangles with a repeated vertex");

  surface = tetrahedron();
  surface.points[3] = {0.25, 0, 0};
  expect_flaw(surface, "1 triangles of zero area");

  surface = tetrahedron();
  append(surface, tetrahedron(), 5);
  for (auto& triangle : surface.triangles) {
    for (auto& v : triangle) v = v == 4 ? 0 : v > 4 ? v - 1 : v;
  }
  surface.points.erase(surface.points.begin() + 4);
  expect_flaw(surface, "1 vertices with more than one fan");

  surface = tetrahedron();
  surface.triangles[2][1] = 4;
  expect_flaw(surface, "names vertex 4 of 4");

  surface = tetrahedron();
  surface.points[1][1] = std::numeric_limits<double>::quiet_NaN();
  expect_flaw(surface, "not finite");
}

TEST(BoundaryIsOnBorder, TellsInnerEdgesFromThoseOnAFace) {
  const Surface triangle = {{{0, 1, 1}, {0, 3, 1}, {2, 0, 1}}, {{0, 1, 2}}};
  EXPECT_FALSE(boundary_is_on_border(triangle, {5, 5, 5}, {}));
  const Surface on_face = {{{0, 1, 1}, {0, 3, 1}, {0, 0, 2}}, {{0, 1, 2}}};
  EXPECT_TRUE(boundary_is_on_border(on_face, {5, 5, 5}, {}));
}

TEST(NaivelySmoothed, MovesOnlyWhatIsFree) {
  const Surface pyramid = {{{0, 0, 0}, {4, 0, 0}, {4, 4, 0}, {0, 4, 0}, {1, 1, 8}},
                           {{0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}}};
  const Surface half = naively_smoothed(pyramid, {0.5});
  EXPECT_EQ(half.points[4], (Point{1.5, 1.5, 4}));
  for (std::size_t v = 0; v < 4; ++v) EXPECT_EQ(half.points[v], pyramid.points[v]);
}

}  // namespace
}  // namespace isomesh::test
