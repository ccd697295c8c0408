#include "server/mesh/measure/measure.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/topology/topology.h"
#include "tests/support/any_threads.h"
#include "tests/support/kernels.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/nifti.h"
#include "tests/support/shapes.h"

namespace isomesh::mesh {
namespace {

void expect_extent(const Mesh& mesh) {
  const test::ExtentFacts expected = test::extent_of(test::surface_of(mesh), mesh.origin);
  const Extent extent = measure_extent(mesh, {});
  EXPECT_NEAR(extent.area_mm2, expected.area, 1e-9 * expected.area);
  EXPECT_NEAR(extent.volume_mm3, expected.volume,
              1e-9 * (std::abs(expected.volume) + expected.area));
  EXPECT_EQ(extent.low, expected.low);
  EXPECT_EQ(extent.high, expected.high);
}

void expect_topology(const Mesh& mesh) {
  const test::TopologyFacts expected = test::topology_of(test::surface_of(mesh));
  const Topology topology = measure_topology(mesh, {});
  EXPECT_EQ(topology.boundary_edges, expected.boundary_edges.size());
  EXPECT_EQ(topology.components, expected.components);
  EXPECT_EQ(topology.euler, expected.euler);
}

void expect_measures(const Mesh& mesh) {
  expect_extent(mesh);
  expect_topology(mesh);
}

Mesh two_balls_and_a_torus() {
  const test::Field first = test::sphere({9, 8, 8}, 5.3);
  const test::Field second = test::sphere({11, 21, 9}, 4.1);
  const test::Field ring = test::torus({12, 15, 25}, 7, 2.4);
  const auto field = [&](const test::Point& p) { return std::max({first(p), second(p), ring(p)}); };
  return test::extracted(test::sample<float>(field, {25, 31, 33}), {});
}

Mesh open_noise() {
  return test::extracted(test::noise<std::uint8_t>({0, 1, 2, 3}, {40, 19, 70}, 41),
                         {2, Scheme::kFive, Interpolation::kLinear});
}

TEST(Measure, ClosedComponents) {
  const Mesh mesh = two_balls_and_a_torus();
  expect_measures(mesh);
  const Topology topology = measure_topology(mesh, {});
  EXPECT_EQ(topology.boundary_edges, 0U);
  EXPECT_EQ(topology.components, 3U);
  EXPECT_EQ(topology.euler, 2 + 2 + 0);
}

TEST(Measure, ABallInABallHasTwoComponents) {
  const auto shell = [](const test::Point& p) {
    return std::min(test::sphere({12, 12, 12}, 9.3)(p), -test::sphere({12, 12, 12}, 4.7)(p));
  };
  const Mesh mesh = test::extracted(test::sample<double>(shell, {25, 25, 25}), {});
  expect_measures(mesh);
  const double exact = 4.0 / 3 * std::numbers::pi * (std::pow(9.3, 3) - std::pow(4.7, 3));
  EXPECT_NEAR(measure_extent(mesh, {}).volume_mm3, exact, 0.03 * exact);
  EXPECT_EQ(measure_topology(mesh, {}).components, 2U);
}

TEST(Measure, AnOpenSurface) {
  const test::Field field = test::plane({2.0 / 7, 3.0 / 7, 6.0 / 7}, 9);
  const Mesh mesh = test::extracted(test::sample<float>(field, {20, 18, 16}), {});
  expect_measures(mesh);
  EXPECT_GT(measure_topology(mesh, {}).boundary_edges, 0U);
  EXPECT_EQ(measure_topology(mesh, {}).euler, 1);
  // The cone over the plane from the origin: a third of the plane's distance times its area.
  const Extent extent = measure_extent(mesh, {});
  EXPECT_NEAR(extent.volume_mm3, 9 * extent.area_mm2 / 3, 1e-2);
}

TEST(Measure, AnOpenSurfaceIsClosedToTheVolumesOrigin) {
  for (const auto& [name, geometry] : test::all_geometries()) {
    SCOPED_TRACE(name);
    const auto volume = test::noise<std::uint8_t>({0, 3, 9}, {14, 13, 12}, 45, geometry);
    const Mesh mesh = test::extracted(volume, {2, Scheme::kSix, Interpolation::kLinear});
    const test::ExtentFacts expected = test::extent_of(test::surface_of(mesh), geometry.origin);
    const Extent extent = measure_extent(mesh, {});
    EXPECT_NEAR(extent.volume_mm3, expected.volume, 1e-9 * expected.area);
  }
}

TEST(Measure, NoiseOfManyComponentsLoopsAndHandles) {
  const Mesh mesh = open_noise();
  expect_measures(mesh);
  EXPECT_GT(measure_topology(mesh, {}).components, 10U);
}

TEST(Measure, EveryWayToExtract) {
  const auto volume = test::noise<std::int8_t>({-9, -1, 0, 4}, {13, 12, 11}, 42);
  for (const Scheme scheme : {Scheme::kFive, Scheme::kSix}) {
    for (const Interpolation interpolation : {Interpolation::kLinear, Interpolation::kMidpoint}) {
      expect_measures(test::extracted(volume, {0, scheme, interpolation}));
    }
  }
}

TEST(Measure, AClosedSurfaceHasTheSameSizeWhereverItLies) {
  for (const auto& [name, geometry] : test::all_geometries()) {
    SCOPED_TRACE(name);
    auto volume = test::noise<std::uint8_t>({0, 3, 9}, {14, 13, 12}, 43, geometry);
    test::set_border<std::uint8_t>(volume, 0);
    const Mesh mesh = test::extracted(volume, {2, Scheme::kSix, Interpolation::kLinear});
    const test::ExtentFacts expected = test::extent_of(test::surface_of(mesh));
    const Extent extent = measure_extent(mesh, {});
    EXPECT_GT(extent.volume_mm3, 0);
    EXPECT_NEAR(extent.volume_mm3, expected.volume, 1e-7 * expected.volume);
    EXPECT_NEAR(extent.area_mm2, expected.area, 1e-9 * expected.area);
    EXPECT_EQ(extent.low, expected.low);
    EXPECT_EQ(extent.high, expected.high);
    EXPECT_EQ(measure_topology(mesh, {}).boundary_edges, 0U);
  }
}

TEST(Measure, AnEmptyMeshIsAllZeros) {
  const Mesh extracted_empty = test::extracted(test::constant<float>(1, {9, 9, 9}), {5});
  const Mesh never_filled;
  for (const Mesh* mesh : {&extracted_empty, &never_filled}) {
    const Extent extent = measure_extent(*mesh, {});
    EXPECT_EQ(extent.area_mm2, 0);
    EXPECT_EQ(extent.volume_mm3, 0);
    EXPECT_EQ(extent.low, (std::array<double, 3>{0, 0, 0}));
    EXPECT_EQ(extent.high, (std::array<double, 3>{0, 0, 0}));
    const Topology topology = measure_topology(*mesh, {});
    EXPECT_EQ(topology.boundary_edges, 0U);
    EXPECT_EQ(topology.components, 0U);
    EXPECT_EQ(topology.euler, 0);
  }
}

TEST(Measure, BoundsOfAMeshAwayFromTheOriginDoNotReachIt) {
  const auto volume = test::noise<std::uint8_t>({0, 9}, {6, 6, 6}, 44, test::far_geometry());
  const Extent extent = measure_extent(test::extracted(volume, {5}), {});
  EXPECT_LT(extent.high[2], -1190);
  EXPECT_GE(extent.low[2], -1200);
}

TEST(Measure, IsTheSameToTheBitOnAnyNumberOfThreads) {
  const Mesh mesh = open_noise();
  test::expect_same_on_any_threads([&] {
    const auto [area_mm2, volume_mm3, low, high] = measure_extent(mesh, {});
    return std::tuple(area_mm2, volume_mm3, low, high, measure_topology(mesh, {}));
  });
}

TEST(Measure, IsCancelledBeforeTheStart) {
  const Mesh mesh = open_noise();
  std::stop_source source;
  source.request_stop();
  const Context stopped{source.get_token(), {}};
  const auto expect_cancelled = [](const auto& work) {
    try {
      work();
      FAIL() << "it was not cancelled";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kCancelled);
    }
  };
  expect_cancelled([&] { measure_extent(mesh, stopped); });
  expect_cancelled([&] { measure_topology(mesh, stopped); });
}

TEST(Measure, TheBrain) {
  const auto volume = test::read_nifti_samples(test::kBrainFile);
  const Mesh mesh =
      test::extracted(volume, {test::kBrainIso, Scheme::kFive, Interpolation::kLinear});
  const Extent extent = measure_extent(mesh, {});
  EXPECT_NEAR(extent.area_mm2, 581722.65, 0.5);
  EXPECT_NEAR(extent.volume_mm3, 2794653.21, 0.5);
  const Topology topology = measure_topology(mesh, {});
  EXPECT_EQ(topology.boundary_edges, 6964U);
  EXPECT_EQ(topology.components, 2270U);
  EXPECT_EQ(topology.euler, -884);
}

}  // namespace
}  // namespace isomesh::mesh
