#include "server/mesh/measure/shapes.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/extract/extract.h"
#include "tests/support/any_threads.h"
#include "tests/support/errors.h"
#include "tests/support/kernels.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/shapes.h"

namespace isomesh::mesh {
namespace {

using test::mesh_of;

// Ratio and smallest angle in degrees by their definitions, in double precision.
std::pair<double, double> shape_of(const test::Surface& surface, const Triangle& triangle) {
  std::array<double, 3> sides;
  for (std::size_t n = 0; n < 3; ++n) {
    const test::Point& a = surface.points[triangle[n]];
    const test::Point& b = surface.points[triangle[(n + 1) % 3]];
    sides[n] = std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
  }
  std::ranges::sort(sides);
  const auto& [a, b, c] = sides;  // Heron's formula as W. Kahan writes it
  const double area =
      std::sqrt(std::max(0.0, (c + (b + a)) * (a - (c - b)) * (a + (c - b)) * (c + (b - a)))) / 4;
  const double inradius = 2 * area / (a + b + c);
  const double circumradius = a * b * c / (4 * area);
  const double angle = 2 * std::atan2(std::sqrt(std::max(0.0, (a - (c - b)) * (a + (c - b)))),
                                      std::sqrt((a + (b + c)) * ((b - a) + c)));
  return {area > 0 ? 2 * inradius / circumradius : 0, angle * 180 / std::numbers::pi};
}

// Triangles can lie in the next bin when they are on its edge but for rounding.
void expect_near(const Distribution& found, const std::vector<double>& values, double per_bin,
                 double tolerance) {
  double sum = 0;
  for (const double value : values) sum += value;
  EXPECT_NEAR(found.mean, sum / static_cast<double>(values.size()), tolerance);
  EXPECT_NEAR(found.min, std::ranges::min(values), tolerance);
  std::uint64_t below = 0;
  for (std::size_t bin = 0; bin < Distribution::kBins; ++bin) {
    below += found.histogram[bin];
    const double edge = static_cast<double>(bin + 1) / per_bin;
    const auto at_most = [&](double limit) {
      return static_cast<std::uint64_t>(
          std::ranges::count_if(values, [&](double value) { return value < limit; }));
    };
    if (bin + 1 == Distribution::kBins) break;
    EXPECT_GE(below, at_most(edge - tolerance)) << bin;
    EXPECT_LE(below, at_most(edge + tolerance)) << bin;
  }
  EXPECT_EQ(below, values.size());
}

void expect_shapes(const Mesh& mesh) {
  const test::Surface surface = test::surface_of(mesh);
  std::vector<double> ratios;
  std::vector<double> angles;
  for (const Triangle& triangle : mesh.triangles) {
    const auto [ratio, angle] = shape_of(surface, triangle);
    ratios.push_back(ratio);
    angles.push_back(angle);
  }
  const Shapes shapes = measure_shapes(mesh, {});
  expect_near(shapes.aspect_ratio, ratios, 20, 1e-4);
  expect_near(shapes.smallest_angle_deg, angles, 20.0 / 60, 1e-3);
}

TEST(Shapes, OfKnownTriangles) {
  const auto of = [](const Vec3& a, const Vec3& b, const Vec3& c) {
    return measure_shapes(mesh_of({a, b, c}, {{0, 1, 2}}), {});
  };
  const float height = std::sqrt(3.0F) / 2;
  const Shapes equilateral = of({5, 5, 5}, {6, 5, 5}, {5.5F, 5 + height, 5});
  EXPECT_NEAR(equilateral.aspect_ratio.mean, 1, 1e-5);
  EXPECT_NEAR(equilateral.smallest_angle_deg.mean, 60, 1e-3);
  EXPECT_EQ(equilateral.aspect_ratio.histogram[19], 1U);
  EXPECT_EQ(equilateral.smallest_angle_deg.histogram[19], 1U);
  // Legs of one: r = 1 - 1/sqrt 2, R = sqrt 2 / 2.
  const Shapes right = of({0, 0, 0}, {0, 1, 0}, {0, 0, 1});
  EXPECT_NEAR(right.aspect_ratio.mean, 2 * std::sqrt(2.0) - 2, 1e-6);
  EXPECT_NEAR(right.smallest_angle_deg.min, 45, 1e-4);
  EXPECT_EQ(right.aspect_ratio.histogram[16], 1U);
  EXPECT_EQ(right.smallest_angle_deg.histogram[15], 1U);
  const Shapes flat = of({0, 0, 0}, {1, 1, 1}, {3, 3, 3});
  EXPECT_NEAR(flat.aspect_ratio.mean, 0, 1e-6);
  EXPECT_NEAR(flat.smallest_angle_deg.mean, 0, 1e-3);
  EXPECT_EQ(flat.aspect_ratio.histogram[0], 1U);
  const Shapes point = of({2, 2, 2}, {2, 2, 2}, {2, 2, 2});
  EXPECT_EQ(point.aspect_ratio.mean, 0);
  EXPECT_EQ(point.smallest_angle_deg.min, 0);
}

TEST(Shapes, DoNotDependOnTheSizeOfATriangle) {
  for (const float size : {1e-15F, 1e-6F, 1e6F, 1e15F}) {
    const Shapes shapes =
        measure_shapes(mesh_of({{0, 0, 0}, {size, 0, 0}, {0, 2 * size, 0}}, {{0, 1, 2}}), {});
    EXPECT_NEAR(shapes.smallest_angle_deg.mean, std::atan(0.5) * 180 / std::numbers::pi, 1e-3);
    EXPECT_NEAR(shapes.aspect_ratio.mean, 0.6832816, 1e-5);
  }
}

TEST(Shapes, AreThoseOfTheDefinition) {
  expect_shapes(
      test::extracted(test::noise<std::int16_t>({-7, -2, 0, 1, 4}, {23, 20, 19}, 1), {0.5}));
  expect_shapes(
      test::extracted(test::sample<float>(test::gyroid(9), {30, 31, 29}), {0.1, Scheme::kFive}));
  expect_shapes(test::extracted(test::noise<std::uint8_t>({0, 1, 2}, {9, 9, 9}, 2), {1}));
}

// Means and histogram shares of the measured sample agree with those of all triangles.
TEST(Shapes, OfManyTrianglesAreThoseOfASample) {
  const Mesh mesh =
      test::extracted(test::noise<std::int16_t>({-7, -2, 0, 1, 4, 9}, {61, 60, 59}, 4), {0.5});
  const std::size_t triangles = mesh.triangles.size();
  ASSERT_GT(triangles, kMostMeasuredTriangles);
  const test::Surface surface = test::surface_of(mesh);
  double ratios = 0;
  double angles = 0;
  std::array<double, Distribution::kBins> shares = {};
  for (const Triangle& triangle : mesh.triangles) {
    const auto [ratio, angle] = shape_of(surface, triangle);
    ratios += ratio;
    angles += angle;
    const auto bin = static_cast<std::size_t>(ratio * Distribution::kBins);
    shares[std::min(bin, shares.size() - 1)] += 1.0 / static_cast<double>(triangles);
  }
  const Shapes shapes = measure_shapes(mesh, {});
  EXPECT_NEAR(shapes.aspect_ratio.mean, ratios / static_cast<double>(triangles), 1e-3);
  EXPECT_NEAR(shapes.smallest_angle_deg.mean, angles / static_cast<double>(triangles), 0.05);
  const auto& histogram = shapes.aspect_ratio.histogram;
  const auto measured = std::accumulate(histogram.begin(), histogram.end(), std::uint64_t{0});
  EXPECT_GE(measured, kMostMeasuredTriangles / 3);
  EXPECT_LE(measured, kMostMeasuredTriangles);
  for (std::size_t bin = 0; bin < Distribution::kBins; ++bin) {
    const auto share = static_cast<double>(histogram[bin]) / static_cast<double>(measured);
    EXPECT_NEAR(share, shares[bin], 2e-3) << bin;
  }
}

TEST(Shapes, OfNothingAreZero) {
  const Shapes shapes = measure_shapes(Mesh{}, {});
  EXPECT_EQ(shapes.aspect_ratio, Distribution{});
  EXPECT_EQ(shapes.smallest_angle_deg, Distribution{});
}

TEST(Shapes, AreTheSameOnAnyNumberOfThreads) {
  const Mesh mesh = test::extracted(test::noise<std::uint8_t>({0, 1}, {40, 40, 40}, 3), {0.5});
  ASSERT_GT(mesh.triangles.size(), 200'000U);
  test::expect_same_on_any_threads([&] {
    const auto [aspect_ratio, smallest_angle_deg] = measure_shapes(mesh, {});
    return std::pair(aspect_ratio, smallest_angle_deg);
  });
}

TEST(Quality, StopsWhenItIsCancelled) {
  std::stop_source stop;
  stop.request_stop();
  const Context stopped = {stop.get_token(), {}};
  const Mesh mesh = mesh_of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}});
  EXPECT_EQ(test::code_thrown_by([&] { measure_shapes(mesh, stopped); }), ErrorCode::kCancelled);
}

}  // namespace
}  // namespace isomesh::mesh
