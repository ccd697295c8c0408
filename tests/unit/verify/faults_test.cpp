// Faults are planted into a right mesh, at several places each; all are found.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/verify/made.h"

namespace isomesh::test {
namespace {

using testing::HasSubstr;
using verify::Surface;
using verify::Vec;
using verify::operator+;
using verify::operator*;
using verify::operator-;

constexpr double kBound = 0.05;
constexpr std::array<double, 4> kPlaces = {0.1, 0.37, 0.62, 0.93};  // of the triangles

class VerifyFaults : public testing::Test {
 protected:
  // `plant` makes a fault at a triangle of the mesh.
  void expect_found(const std::function<void(Surface&, std::size_t triangle)>& plant,
                    const std::string& text) {
    for (const double place : kPlaces) {
      Surface mesh = right_;
      const auto count = static_cast<double>(mesh.triangles.size());
      plant(mesh, static_cast<std::size_t>(place * count));
      const verify::Verdict said = verdict(mesh, volume_, parameters_);
      EXPECT_FALSE(said.holds) << place;
      EXPECT_THAT(said.text, HasSubstr(text)) << place;
      EXPECT_THAT(said.text, HasSubstr("FAILED"));
    }
  }

  // The distance of a point from the surface, by all of its triangles.
  double distance(const Vec& point) const {
    double least = INFINITY;
    for (std::size_t t = 0; t < surface_.triangles.size(); ++t) {
      least = std::min(least, verify::squared_distance(point, surface_.corners(t), least));
    }
    return std::sqrt(least);
  }

  const SampleVolume<float> volume_ = balls();
  const MeshParameters parameters_ = parameters_within(kBound);
  const Surface right_ = verify::read_surface(made(volume_, parameters_));
  const Surface surface_ = verify::zero_set(field_of(volume_), {});
};

TEST_F(VerifyFaults, AreNoneInTheMeshThatWasMade) {
  const verify::Verdict said = verdict(right_, volume_, parameters_);
  EXPECT_TRUE(said.holds) << said.text;
}

// Outwards along the normal, to a hundredth of the bound beyond it.
TEST_F(VerifyFaults, OfAVertexThatIsALittleTooFar) {
  expect_found(
      [this](Surface& mesh, std::size_t triangle) {
        Vec& vertex = mesh.points[mesh.triangles[triangle][0]];
        const Vec normal = verify::normal_of(mesh.corners(triangle));
        const Vec out = 1 / std::sqrt(verify::squared(normal)) * normal;
        const Vec from = vertex;
        double low = 0;
        double high = 4 * kBound;
        for (int n = 0; n < 60; ++n) {
          const double middle = (low + high) / 2;
          vertex = from + middle * out;
          (distance(vertex) < 1.01 * kBound ? low : high) = middle;
        }
        ASSERT_NEAR(distance(vertex), 1.01 * kBound, 1e-6);
      },
      "triangles have points farther than 0.05 mm");
}

TEST_F(VerifyFaults, OfATriangleThatIsMissing) {
  expect_found(
      [](Surface& mesh, std::size_t triangle) {
        mesh.triangles.erase(mesh.triangles.begin() + static_cast<std::ptrdiff_t>(triangle));
      },
      "Other open edges: 3, such as at (");
}

TEST_F(VerifyFaults, OfATriangleThatIsTurned) {
  expect_found(
      [](Surface& mesh, std::size_t triangle) {
        std::swap(mesh.triangles[triangle][0], mesh.triangles[triangle][1]);
      },
      "Edges where a triangle is turned against its neighbour: 3, such as at (");
}

TEST_F(VerifyFaults, OfATriangleThatIsThereTwice) {
  expect_found([](Surface& mesh,
                  std::size_t triangle) { mesh.triangles.push_back(mesh.triangles[triangle]); },
               "Edges of three triangles, or five and so on: 3, such as at (");
}

TEST_F(VerifyFaults, OfAComponentThatIsMissing) {
  expect_found(
      [](Surface& mesh, std::size_t triangle) {
        const auto components = verify::components_of(mesh);
        const std::uint32_t lost = components[mesh.triangles[triangle][0]];
        std::erase_if(mesh.triangles,
                      [&](const verify::Indices& t) { return components[t[0]] == lost; });
      },
      "From the surface to the mesh: ");
}

TEST_F(VerifyFaults, OfAComponentThatIsInsideOut) {
  expect_found(
      [](Surface& mesh, std::size_t triangle) {
        const auto components = verify::components_of(mesh);
        const std::uint32_t turned = components[mesh.triangles[triangle][0]];
        for (verify::Indices& t : mesh.triangles) {
          if (components[t[0]] == turned) std::swap(t[0], t[1]);
        }
      },
      "Components inside out: 1, such as at (");
}

TEST_F(VerifyFaults, OfAComponentThatIsTooMuch) {
  expect_found(
      [](Surface& mesh, std::size_t triangle) {
        const verify::Corners corners = mesh.corners(triangle);
        const auto first = static_cast<std::uint32_t>(mesh.points.size());
        for (const Vec& corner : corners) mesh.points.push_back(corner + Vec{0, 0, 0.3});
        mesh.points.push_back(corners[0] + Vec{0.1, 0.1, 0.5});
        for (const verify::Indices& t : {verify::Indices{0, 1, 2}, verify::Indices{0, 3, 1},
                                         verify::Indices{1, 3, 2}, verify::Indices{2, 3, 0}}) {
          mesh.triangles.push_back({first + t[0], first + t[1], first + t[2]});
        }
      },
      "triangles have points farther than 0.05 mm");
}

// A mesh of only the component that has the most triangles, and of any other.
TEST_F(VerifyFaults, OfComponentsAreNoneIfTheJobLeavesThemOut) {
  MeshParameters parameters = parameters_;
  parameters.components.keep = 1;
  Surface largest = surface_;
  verify::keep_components(parameters.components, largest);
  const verify::Tree kept(largest);
  const auto components = verify::components_of(right_);
  std::set<std::uint32_t> of_mesh;
  for (const verify::Indices& t : right_.triangles) of_mesh.insert(components[t[0]]);
  ASSERT_EQ(of_mesh.size(), 3U);
  std::size_t right = 0;
  for (const std::uint32_t one : of_mesh) {
    Surface mesh = right_;
    std::erase_if(mesh.triangles,
                  [&](const verify::Indices& t) { return components[t[0]] != one; });
    EXPECT_FALSE(verdict(mesh, volume_, parameters_).holds);
    const bool is_largest =
        kept.nearest(mesh.points[mesh.triangles[0][0]], 0).squared <= kBound * kBound;
    const verify::Verdict said = verdict(mesh, volume_, parameters);
    EXPECT_EQ(said.holds, is_largest) << said.text;
    EXPECT_THAT(said.text, HasSubstr("in 3 components, of which the job keeps 1, of "));
    if (!is_largest) continue;
    ++right;
    mesh.triangles.pop_back();
    EXPECT_FALSE(verdict(mesh, volume_, parameters).holds);
  }
  EXPECT_EQ(right, 1U);
}

// The mesh is nearer to the rod than to the ball in places, but the job kept only the ball.
TEST(VerifyComponents, BesideTheOneThatIsKeptAreNotAskedFor) {
  const Vec centre = {10, 10, 8};
  auto volume = sample<float>(sphere({10, 10, 8}, 6), {21, 21, 25}, Geometry{});
  MeshParameters parameters = parameters_within(1.5);
  parameters.max_error_mm.reset();
  parameters.regularize = false;
  Surface mesh = verify::read_surface(made(volume, parameters));
  for (std::uint32_t k = 16; k < 23; ++k) volume.at(10, 10, k) = 1;
  parameters.max_error_mm = 1.5;
  parameters.components.keep = 1;
  for (Vec& point : mesh.points) point = centre + 1.2 * (point - centre);
  EXPECT_TRUE(verdict(mesh, volume, parameters).holds) << verdict(mesh, volume, parameters).text;
  parameters.components.keep = 2;
  const verify::Verdict said = verdict(mesh, volume, parameters);
  EXPECT_FALSE(said.holds);
  EXPECT_THAT(said.text, HasSubstr(", in the surface's component 2 of 2, of "));
}

// Far points say where they belong to: of three balls' surfaces the smallest is missing.
TEST_F(VerifyFaults, AreToldWithTheirComponent) {
  Surface mesh = right_;
  ComponentFilter filter;
  filter.keep = 2;
  verify::keep_components(filter, mesh);
  EXPECT_THAT(verdict(mesh, volume_, parameters_).text,
              testing::ContainsRegex("mm at \\(.*\\), in the surface's component 3 of 3, of [0-9]+ "
                                     "triangles"));
  mesh = right_;
  const auto components = verify::components_of(mesh);
  for (std::size_t n = 0; n < mesh.points.size(); ++n) {
    if (components[n] == components[mesh.triangles[0][0]]) mesh.points[n][0] -= 3 * kBound;
  }
  EXPECT_THAT(
      verdict(mesh, volume_, parameters_).text,
      testing::ContainsRegex("mm at \\(.*\\), in the mesh's component [123] of 3, of [0-9]+ "
                             "triangles"));
}

TEST_F(VerifyFaults, OfAWholeSurfaceThatIsMoved) {
  Surface mesh = right_;
  for (Vec& point : mesh.points) point[1] += 2.1 * kBound;
  const verify::Verdict said = verdict(mesh, volume_, parameters_);
  EXPECT_FALSE(said.holds);
  EXPECT_THAT(said.text, testing::ContainsRegex("0\\.1[0-9]* mm at \\("));
}

}  // namespace
}  // namespace isomesh::test
