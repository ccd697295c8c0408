// The work of a TriangleGrid: how many cells, boxes and triangles it looks at, never how long.
#include "server/mesh/measure/triangle_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/measure/self_intersections.h"
#include "server/mesh/smooth/smooth.h"
#include "tests/support/any_threads.h"
#include "tests/support/kernels.h"
#include "tests/support/shapes.h"
#include "tests/unit/mesh/separated.h"

namespace isomesh::mesh {
namespace {

using test::copy_of;
using test::mesh_of;

constexpr std::uint32_t kNone = TriangleGrid::kNone;

struct Found {
  std::vector<double> squared_mm;
  double steps = 0;  // for a point
};

// At all measured points of a surface, each with its neighbour's triangle as the guess.
Found nearest_of(const SurfaceView& from, const TriangleGrid& to) {
  Found found;
  std::uint32_t guess = kNone;
  std::uint64_t steps = 0;
  for (std::size_t n = 0; n < from.positions.size() + from.triangles.size(); ++n) {
    const TriangleGrid::Nearest nearest = to.nearest(measured_point(from, n), guess);
    guess = nearest.triangle;
    steps += nearest.steps;
    found.squared_mm.push_back(nearest.squared_mm);
  }
  found.steps = static_cast<double>(steps) / static_cast<double>(found.squared_mm.size());
  return found;
}

// Over all triangles, one by one.
double plain_squared(const Point& point, const SurfaceView& surface) {
  double squared = std::numeric_limits<double>::infinity();
  for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
    squared = std::min(squared, squared_distance(point, corners_of(surface, t)));
  }
  return squared;
}

// Compares some of them to the bit.
void expect_as_plain(const Found& found, const SurfaceView& from, const SurfaceView& to) {
  const std::size_t step = std::max<std::size_t>(1, found.squared_mm.size() / 10);
  for (std::size_t n = 0; n < found.squared_mm.size(); n += step) {
    EXPECT_EQ(found.squared_mm[n], plain_squared(measured_point(from, n), to)) << n;
  }
}

// The work for a triangle of a surface.
struct Cost {
  double steps = 0;   // to find the nearest triangle to a point of a surface beside it
  double pairs = 0;   // that may intersect
  double tested = 0;  // cells
  double memory = 0;  // entries and nodes
  double met = 0;     // triangles that a line along x may meet
};

Cost cost_of(const SurfaceView& surface, const SurfaceView& beside) {
  const TriangleGrid grid(surface, {});
  const auto triangles = static_cast<double>(surface.triangles.size());
  const Found found = nearest_of(beside, grid);
  expect_as_plain(found, beside, surface);
  std::uint64_t pairs = 0;
  for (std::size_t part = 0; part < grid.parts(); ++part) {
    grid.visit_pairs(
        part, [](auto) {}, [&](std::size_t, std::size_t) { ++pairs; });
  }
  const TriangleGrid::Size size = grid.size();
  std::uint64_t met = 0;
  constexpr std::size_t kLines = 100;
  float end_x = -std::numeric_limits<float>::infinity();
  for (const Vec3& position : surface.positions) end_x = std::max(end_x, position[0]);
  for (std::size_t n = 0; n < kLines; ++n) {
    const Point from = measured_point(surface, n * (surface.positions.size() / kLines));
    grid.visit_along(from, {end_x, from[1], from[2]}, [&](std::uint32_t) { ++met; });
  }
  return {found.steps, static_cast<double>(pairs) / triangles,
          static_cast<double>(size.tested_cells) / triangles,
          static_cast<double>(size.entries + size.nodes) / triangles,
          static_cast<double>(met) / kLines};
}

Mesh smoothed(const Mesh& mesh) {
  Mesh result = copy_of(mesh);
  smooth(test::method_options(Smoothing::kTaubin, 10), {}, result);
  return result;
}

struct Way {
  std::string name;
  Geometry geometry;
};

// Along the axes, and at an angle to all of them.
std::vector<Way> uneven_ways() {
  std::vector<Way> ways;
  for (const bool is_oblique : {false, true}) {
    for (const std::array<double, 3>& spacing :
         {std::array<double, 3>{1, 1, 1}, {1, 1, 1000}, {1000, 1, 1}, {0.01, 10, 1}}) {
      Geometry geometry = is_oblique ? test::oblique_geometry() : Geometry{};
      geometry.spacing = spacing;
      std::string name = is_oblique ? "oblique" : "straight";
      for (const double side : spacing) name += " " + std::to_string(side);
      ways.push_back({name, geometry});
    }
  }
  return ways;
}

// Labels at random: walls everywhere.
Mesh walls_of_noise(std::uint32_t n, const Geometry& geometry) {
  return std::move(separated(label_noise(4, {n, n, n}, 7, geometry),
                             {consecutive<std::int64_t>(1, 3), Scheme::kSix, false})
                       .mesh);
}

// A block with wide flat faces, which smoothing moves far away at its edges.
Mesh wall_of_block(std::uint32_t n, const Geometry& geometry) {
  auto volume = test::constant<std::uint8_t>(1, {n, n, 10});
  volume.geometry = geometry;
  test::set_border<std::uint8_t>(volume, 0);
  return std::move(separated(volume, {{1}, Scheme::kSix, false}).mesh);
}

TEST(TriangleGrid, LooksAtAsFewTrianglesAtAnySpacing) {
  for (const Way& way : uneven_ways()) {
    const Mesh noise = walls_of_noise(10, way.geometry);
    const Mesh block = wall_of_block(36, way.geometry);
    for (const Mesh* mesh : {&noise, &block}) {
      const Cost cost = cost_of(*mesh, smoothed(*mesh));
      ASSERT_GT(mesh->triangles.size(), 15'000U);
      EXPECT_LT(cost.steps, 120) << way.name;
      EXPECT_LT(cost.pairs, 60) << way.name;
      EXPECT_LT(cost.tested, 6) << way.name;
      EXPECT_LT(cost.memory, 6) << way.name;
    }
  }
}

// Twice as many samples along each axis of the block are four times as many triangles.
TEST(TriangleGrid, LooksAtHardlyMoreOfMoreTriangles) {
  for (const Way& way : uneven_ways()) {
    const Mesh small = wall_of_block(18, way.geometry);
    const Mesh large = wall_of_block(54, way.geometry);
    const Cost before = cost_of(small, smoothed(small));
    const Cost after = cost_of(large, smoothed(large));
    ASSERT_GT(large.triangles.size(), 6 * small.triangles.size());
    EXPECT_LT(after.steps, 1.5 * before.steps) << way.name;
    EXPECT_LT(after.pairs, 1.5 * before.pairs) << way.name;
    EXPECT_LT(after.met, 4 * before.met) << way.name;
  }
}

// n x n squares with sides of 1 mm.
struct Sheet {
  std::vector<Vec3> positions;
  std::vector<Triangle> triangles;

  void add(std::uint32_t n, const Vec3& at) {
    const auto first = static_cast<std::uint32_t>(positions.size());
    for (std::uint32_t y = 0; y <= n; ++y) {
      for (std::uint32_t x = 0; x <= n; ++x) {
        positions.push_back({at[0] + static_cast<float>(x), at[1] + static_cast<float>(y), at[2]});
        if (x == n || y == n) continue;
        const std::uint32_t corner = first + y * (n + 1) + x;
        triangles.push_back({corner, corner + 1, corner + n + 2});
        triangles.push_back({corner, corner + n + 2, corner + n + 1});
      }
    }
  }
  void add(const std::array<Vec3, 3>& corners) {
    const auto first = static_cast<std::uint32_t>(positions.size());
    positions.insert(positions.end(), corners.begin(), corners.end());
    triangles.push_back({first, first + 1, first + 2});
  }
  SurfaceView view() const { return {positions, triangles}; }
};

// The result of simplifying a flat face beside a detailed one: its edges alone would make the
// cells so large that one has all the small triangles.
TEST(TriangleGrid, ManagesAHugeTriangleAmongTinyOnes) {
  for (const float size : {1e3F, 1e5F, 1e7F}) {
    Sheet sheet;
    sheet.add(120, {0, 0, 0});
    sheet.add({Vec3{-size, -size, size / 2}, {size, -size, -size}, {0, size, size}});
    sheet.add({Vec3{-size, 3, 7}, {size, 3, 7}, {size, 3.01F, 7}});         // thin
    sheet.add({Vec3{-size, -size, -size}, {size, size, size}, {0, 0, 0}});  // a line
    Sheet beside;
    beside.add(120, {0.3F, 0.2F, 0.4F});
    const Cost cost = cost_of(sheet.view(), beside.view());
    EXPECT_LT(cost.steps, 200) << size;
    EXPECT_LT(cost.pairs, 60) << size;
    EXPECT_LT(cost.tested, 12) << size;
    EXPECT_LT(cost.memory, 6) << size;
  }
}

// Each second one is twice as large, and so on: there is no side that suits them all.
TEST(TriangleGrid, ManagesTrianglesOfAllSizes) {
  Sheet sheet;
  float at = 0;
  for (int n = 0; n < 12'000; ++n) {
    const float size = std::exp2(static_cast<float>(n % 20));
    sheet.add({Vec3{at, 0, size}, {at + 1, size, size}, {at, size, 0}});
    at += 1;
  }
  Sheet beside;
  for (int n = 0; n < 12'000; ++n) {
    const auto x = static_cast<float>(n);
    beside.add({Vec3{x, 0.3F, 0.2F}, {x + 0.5F, 0.2F, 0.4F}, {x, 0.1F, 0.7F}});
  }
  const Cost cost = cost_of(sheet.view(), beside.view());
  EXPECT_LT(cost.steps, 300);
  EXPECT_LT(cost.memory, 40);
}

// Two components, a million edges apart: neither the points beside them nor those far from both
// look at all of the triangles.
TEST(TriangleGrid, ManagesComponentsThatAreFarApart) {
  Sheet sheet;
  sheet.add(100, {0, 0, 0});
  sheet.add(100, {1e6F, 0, 3e5F});
  Sheet beside;
  beside.add(100, {0.25F, 0.25F, 0.5F});
  beside.add(100, {1e6F, 0.25F, 3e5F});
  const TriangleGrid grid(sheet.view(), {});
  const Found found = nearest_of(beside.view(), grid);
  expect_as_plain(found, beside.view(), sheet.view());
  EXPECT_LT(found.steps, 60);
  for (const Point& far : {Point{5e5, 50, 1e5}, {-1e6, 3, 9}, {2e6, 1e6, 0}}) {
    for (const std::uint32_t guess : {kNone, 0U, 39'999U}) {
      const TriangleGrid::Nearest nearest = grid.nearest(far, guess);
      EXPECT_EQ(nearest.squared_mm, plain_squared(far, sheet.view()));
      EXPECT_LT(nearest.steps, 2'000U) << far[0];
    }
  }
}

// Most of the cells in the cube around a large ball are not in the ball.
TEST(TriangleGrid, LooksAtFewTrianglesFromFarAway) {
  const Mesh ball =
      test::extracted(test::sample<float>(test::sphere({0, 0, 0}, 0.9), test::unit_cube_dims(64),
                                          test::unit_cube_geometry(64)),
                      {0, Scheme::kSix, Interpolation::kLinear, false});
  ASSERT_GT(ball.triangles.size(), 15'000U);
  const TriangleGrid grid(ball, {});
  for (const Point& far : {Point{9, 8, 7}, {-40, 30, 20}, {0, 1, 60}}) {
    const TriangleGrid::Nearest nearest = grid.nearest(far, kNone);
    EXPECT_EQ(nearest.squared_mm, plain_squared(far, ball));
    EXPECT_LT(nearest.steps, 10'000U);
  }
}

TEST(TriangleGrid, FindsATriangleWithinADistanceInACrowdedCell) {
  Sheet sheet;
  sheet.add(60, {0, 0, 0});
  sheet.add({Vec3{-1e6F, -1e6F, -5}, {1e6F, -1e6F, -5}, {0, 1e6F, -5}});
  const TriangleGrid grid(sheet.view(), {});
  ASSERT_GT(grid.size().nodes, 100U);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> place(-2, 62);
  std::uniform_real_distribution<double> height(-3, 3);
  int found = 0;
  for (int n = 0; n < 300; ++n) {
    const Point point = {place(random), place(random), height(random)};
    for (const double bound : {0.2, 1.0, 2.5}) {
      const TriangleGrid::Nearest nearest = grid.within(point, bound * bound, kNone);
      EXPECT_EQ(nearest.triangle != kNone, plain_squared(point, sheet.view()) <= bound * bound);
      EXPECT_LT(nearest.steps, 400U);
      if (nearest.triangle == kNone) continue;
      ++found;
      EXPECT_LE(nearest.squared_mm, bound * bound);
      EXPECT_EQ(nearest.squared_mm,
                squared_distance(point, corners_of(sheet.view(), nearest.triangle)));
    }
  }
  EXPECT_GT(found, 300);
}

// Trees are made by several threads, and find what cells do.
TEST(TriangleGrid, IsTheSameOnAnyNumberOfThreads) {
  Geometry geometry = test::oblique_geometry();
  geometry.spacing = {1, 1, 300};
  const Mesh walls = walls_of_noise(10, geometry);
  const Mesh beside = smoothed(walls);
  test::expect_same_on_any_threads(
      [&] { return nearest_of(beside, TriangleGrid(walls, {})).squared_mm; });
}

// An axis-aligned lattice that is stretched by a power of two has the same intersections: rounding
// is the same.
TEST(TriangleGrid, FindsTheSameIntersectionsAtAnySpacing) {
  Mesh mesh = walls_of_noise(10, {});
  std::mt19937 random(5);
  std::uniform_real_distribution<float> move(-0.3F, 0.3F);
  for (Vec3& position : mesh.positions) {
    for (float& coordinate : position) coordinate += move(random);
  }
  const SelfIntersections even = find_self_intersections(mesh, {});
  ASSERT_GT(even.pairs, 1'000U);
  for (const std::size_t axis : {0U, 1U, 2U}) {
    Mesh stretched = copy_of(mesh);
    for (Vec3& position : stretched.positions) position[axis] *= 1024;
    const SelfIntersections uneven = find_self_intersections(stretched, {});
    EXPECT_EQ(uneven.pairs, even.pairs);
    EXPECT_EQ(uneven.triangles, even.triangles);
  }
}

}  // namespace
}  // namespace isomesh::mesh
