// Surfaces around the samples below an iso-value: dark structures.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <type_traits>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/collapse/bound.h"
#include "server/mesh/collapse/gradient_normals.h"
#include "server/mesh/measure/cavities.h"
#include "server/mesh/measure/measure.h"
#include "tests/unit/mesh/reference_surface.h"

namespace isomesh::mesh {
namespace {

using test::SampleVolume;

ExtractOptions turned(ExtractOptions options) {
  options.inside = options.inside == Inside::kAbove ? Inside::kBelow : Inside::kAbove;
  return options;
}

// On all three lattices, both placements.
std::vector<ExtractOptions> open_options(double iso) {
  std::vector<ExtractOptions> options = all_options(iso);
  options.push_back({iso, Scheme::kBcc, Interpolation::kLinear});
  options.push_back({iso, Scheme::kBcc, Interpolation::kMidpoint});
  return options;
}

// In order, each beginning with its smallest vertex.
std::vector<Triangle> sorted(std::vector<Triangle> triangles) {
  for (Triangle& triangle : triangles) {
    std::rotate(triangle.begin(), std::ranges::min_element(triangle), triangle.end());
  }
  std::ranges::sort(triangles);
  return triangles;
}

std::vector<Triangle> triangles_of(const Mesh& mesh) {
  return sorted({mesh.triangles.begin(), mesh.triangles.end()});
}

std::vector<Triangle> reversed_triangles_of(const Mesh& mesh) {
  std::vector<Triangle> triangles(mesh.triangles.begin(), mesh.triangles.end());
  for (auto& [a, b, c] : triangles) std::swap(b, c);
  return sorted(std::move(triangles));
}

// ---- The complement

template <class T>
class InsideBelow : public testing::Test {
 protected:
  static constexpr double kLow = std::numeric_limits<T>::lowest();
  static constexpr double kHigh = std::numeric_limits<T>::max();

  static SampleVolume<T> few_values(const Dims& dims, std::uint64_t seed) {
    return test::noise<T>({40, 41, 42, 43, 44}, dims, seed);
  }
  static SampleVolume<T> wide_noise(const Dims& dims, std::uint64_t seed) {
    if (std::is_integral_v<T>) return test::noise_between<T>(kLow, kHigh, dims, seed);
    return test::noise_between<T>(-1000, 1000, dims, seed);
  }
};

using SampleTypes = testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                                   std::uint32_t, std::int32_t, float, double>;
TYPED_TEST_SUITE(InsideBelow, SampleTypes);

// Also of samples at the iso-value, which are outside.
TYPED_TEST(InsideBelow, IsTheSameSurfaceTurnedOver) {
  for (const Dims dims : {Dims{2, 2, 2}, Dims{7, 6, 5}, Dims{65, 4, 3}, Dims{130, 3, 3}}) {
    const auto volume = this->few_values(dims, dims.x);
    for (const double iso : {42.0, 41.5}) {
      for (ExtractOptions options : open_options(iso)) {
        // Midpoints are all equally near, so inside points own them.
        const bool may_join = options.interpolation == Interpolation::kLinear;
        for (options.regularize = false;; options.regularize = true) {
          SCOPED_TRACE(describe(dims, options));
          const Mesh above = test::extracted(volume, options);
          const Mesh below = test::extracted(volume, turned(options));
          ASSERT_GT(above.triangles.size(), 0U);
          ASSERT_TRUE(std::ranges::equal(above.positions, below.positions));
          ASSERT_EQ(reversed_triangles_of(below), triangles_of(above));
          if (options.regularize || !may_join) break;
        }
      }
    }
  }
}

TYPED_TEST(InsideBelow, IsTheReferencesSurface) {
  for (const bool close : {false, true}) {
    for (const double iso : {42.0, 41.5}) {
      for (ExtractOptions options : all_options(iso, close)) {
        options.inside = Inside::kBelow;
        expect_reference_surface(this->few_values({65, 4, 3}, 1), options);
        expect_regular_surface(this->few_values({9, 8, 7}, 2), options);
        options.scheme = Scheme::kBcc;
        expect_reference_surface(this->few_values({5, 6, 4}, 3), options);
        if (this->HasFailure()) return;
      }
    }
  }
}

TYPED_TEST(InsideBelow, TakesAnyIsoValue) {
  constexpr double kMost = std::numeric_limits<double>::max();
  const Dims dims = {4, 3, 5};
  const auto volume = test::noise<TypeParam>(
      {std::numeric_limits<TypeParam>::lowest(), std::numeric_limits<TypeParam>::max()}, dims, 1);
  const auto volume_below = [&](double iso, bool close) {
    const Mesh mesh = test::extracted(
        volume, {iso, Scheme::kSix, Interpolation::kMidpoint, close, false, Inside::kBelow});
    return measure_extent(mesh, {}).volume_mm3;
  };
  constexpr double kBox = 3 * 2 * 4;
  EXPECT_EQ(volume_below(-kMost, true), 0);
  const double low = this->kLow;
  const double high = this->kHigh;
  EXPECT_EQ(volume_below(low, true), 0) << "the lowest value is not below itself";
  EXPECT_GT(volume_below(high, true), 0);
  EXPECT_LT(volume_below(high, true), kBox) << "the highest value is not below itself";
  EXPECT_EQ(volume_below(high, true), volume_below(low / 2 + high / 2, true));
  if (high == kMost) return;
  EXPECT_EQ(volume_below(kMost, false), 0) << "all is inside, so nothing is crossed";
  EXPECT_NEAR(volume_below(kMost, true), kBox, 1e-5 * kBox);
}

// ---- The negative

TEST(InsideBelowNegated, GivesTheMeshThatAboveGivesOfTheSamples) {
  const Dims dims = {20, 9, 8};
  const auto volume = test::noise_between<float>(-100, 100, dims, 7);
  SampleVolume<float> negated = volume;
  for (float& sample : negated.samples) sample = -sample;
  for (const bool close : {false, true}) {
    for (const Scheme scheme : test::kSchemes) {
      for (const bool regularize : {false, true}) {
        const ExtractOptions options = {17.3,  scheme,     Interpolation::kLinear,
                                        close, regularize, Inside::kAbove};
        SCOPED_TRACE(describe(dims, options));
        const Mesh above = test::extracted(volume, options);
        ExtractOptions below = turned(options);
        below.iso = -options.iso;
        const Mesh same = test::extracted(negated, below);
        ASSERT_GT(above.triangles.size(), 0U);
        ASSERT_TRUE(std::ranges::equal(above.positions, same.positions));
        ASSERT_TRUE(std::ranges::equal(above.triangles, same.triangles));
        ASSERT_EQ(above.on_border, same.on_border);
      }
    }
  }
}

// ---- Dark structures

constexpr double kRadius = 8;
constexpr double kBall = 4.0 / 3 * std::numbers::pi * kRadius * kRadius * kRadius;

// Dark in bright surroundings: negative within the ball.
SampleVolume<float> dark_ball(const test::Point& centre) {
  return test::sample<float>(test::scaled(test::sphere(centre, kRadius), -1, 0), {24, 24, 24});
}

TEST(DarkStructures, HaveAPositiveVolume) {
  const auto volume = dark_ball({11.5, 11.5, 11.5});
  for (const Scheme scheme : test::kSchemes) {
    for (const bool regularize : {false, true}) {
      const Mesh mesh = test::extracted(
          volume, {0, scheme, Interpolation::kLinear, false, regularize, Inside::kBelow});
      EXPECT_NEAR(measure_extent(mesh, {}).volume_mm3, kBall, 0.02 * kBall);
    }
  }
}

// The box takes the other half.
TEST(DarkStructures, AreCutByTheBorderAndCapped) {
  const auto volume = dark_ball({11.5, 11.5, 0});
  for (const Scheme scheme : test::kSchemes) {
    ExtractOptions options = {0, scheme, Interpolation::kLinear, true, true, Inside::kBelow};
    const Mesh dark = test::extracted(volume, options);
    EXPECT_TRUE(test::topology_of(test::surface_of(dark)).boundary_edges.empty());
    EXPECT_NEAR(measure_extent(dark, {}).volume_mm3, kBall / 2, 0.02 * kBall);
    options.inside = Inside::kAbove;
    const double bright = measure_extent(test::extracted(volume, options), {}).volume_mm3;
    EXPECT_NEAR(bright + kBall / 2, 23.0 * 23 * 23, 0.02 * kBall);
  }
}

// A bright ball in the dark one.
TEST(DarkStructures, HaveCavities) {
  constexpr double kInner = 4;
  const test::Point centre = {11.5, 11.5, 11.5};
  const auto volume = test::sample<float>(
      [&](const test::Point& p) {
        return std::abs(test::sphere(centre, (kRadius + kInner) / 2)(p)) - (kRadius - kInner) / 2;
      },
      {24, 24, 24});
  const double inner = kBall * std::pow(kInner / kRadius, 3);
  Mesh mesh = test::extracted(volume, {.inside = Inside::kBelow});
  EXPECT_NEAR(measure_extent(mesh, {}).volume_mm3, kBall - inner, 0.02 * kBall);
  const Dropped dropped = fill_cavities({}, mesh);
  EXPECT_EQ(dropped.components, 1U);
  EXPECT_NEAR(measure_extent(mesh, {}).volume_mm3, kBall, 0.02 * kBall);
}

TEST(DarkStructures, AreSimplifiedWithinTheError) {
  const auto volume = dark_ball({11.5, 11.5, 3});
  for (const Scheme scheme : test::kSchemes) {
    const ExtractOptions options = {0, scheme, Interpolation::kLinear, true, false, Inside::kBelow};
    Mesh mesh = test::extracted(volume, options);
    const std::size_t before = mesh.triangles.size();
    const double extracted = measure_extent(mesh, {}).volume_mm3;
    const auto bound = simplify_within(volume.lattice(), options, {.max_error_mm = 0.2}, {}, mesh);
    ASSERT_TRUE(bound);
    EXPECT_LE(bound->bound_mm, 0.2);
    EXPECT_LT(mesh.triangles.size(), before / 2);
    EXPECT_NEAR(measure_extent(mesh, {}).volume_mm3, extracted, 0.05 * extracted);
  }
}

TEST(DarkStructures, HaveNormalsThatPointOut) {
  const test::Point centre = {11.5, 11.5, 11.5};
  const auto volume = dark_ball({11.5, 11.5, 11.5});
  Mesh mesh = test::extracted(volume, {.inside = Inside::kBelow});
  set_gradient_normals(volume.lattice(), Inside::kBelow, {}, mesh);
  for (std::size_t v = 0; v < mesh.normals.size(); ++v) {
    const auto& n = mesh.normals[v];
    const auto& p = mesh.positions[v];
    const double along =
        n[0] * (p[0] - centre[0]) + n[1] * (p[1] - centre[1]) + n[2] * (p[2] - centre[2]);
    ASSERT_GT(along, 0.99 * kRadius - 0.1);
  }
}

}  // namespace
}  // namespace isomesh::mesh
