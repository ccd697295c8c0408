// The volume of simplified surfaces.
#include "server/mesh/collapse/kept_volume.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/collapse/simplify.h"
#include "server/mesh/measure/measure.h"
#include "server/mesh/measure/self_intersections.h"
#include "server/mesh/stairs/stairs.h"
#include "tests/support/any_threads.h"
#include "tests/support/exact_distance.h"
#include "tests/support/step.h"
#include "tests/unit/mesh/separated.h"

namespace isomesh::mesh {
namespace {

using Labels = test::SampleVolume<std::uint8_t>;

constexpr double kUnbounded = std::numeric_limits<double>::infinity();

struct Case {
  std::string name;
  Labels volume;
  std::size_t labels = 1;
};

Labels ellipsoid(const std::array<double, 3>& radii) {
  const auto side = [](double radius) { return static_cast<std::uint32_t>(2 * radius) + 7; };
  const Dims dims = {side(radii[0]), side(radii[1]), side(radii[2])};
  return test::sample<std::uint8_t>(
      [&](const test::Point& p) {
        const double x = (p[0] - dims.x / 2.0 + 0.3) / radii[0];
        const double y = (p[1] - dims.y / 2.0 + 0.1) / radii[1];
        const double z = (p[2] - dims.z / 2.0 - 0.2) / radii[2];
        return x * x + y * y + z * z < 1 ? 1.0 : 0.0;
      },
      dims);
}

std::vector<Case> cases() {
  return {{"ball of 10", ellipsoid({10, 10, 10})},
          {"ball of 16", ellipsoid({16, 16, 16})},
          {"ellipsoid", ellipsoid({20, 9, 13})},
          {"blobs 1", label_cells(5, {40, 36, 38}, 12, 31), 5},
          {"blobs 2", label_cells(9, {44, 44, 44}, 11, 8), 9}};
}

SeparatingSurface smoothed(const Case& one) {
  const SeparateOptions options = {
      .labels = consecutive<std::int64_t>(1, one.labels), .close = true, .regularize = true};
  SeparatingSurface surface = separated(one.volume, options);
  remove_stairs(one.volume.lattice(), options, kUnbounded, {}, surface);
  return surface;
}

// The largest change of a label's volume, as a share. One label alone is compared with its voxels;
// several with what smoothing leaves, which differs from voxels at the border of the volume.
double largest_change(const Case& one, const SeparatingSurface& surface) {
  const std::vector<LabelMeasure> after = label_measures(surface);
  const std::vector<LabelMeasure> before = label_measures(smoothed(one));
  double largest = 0;
  for (std::size_t n = 0; n < after.size(); ++n) {
    const auto voxels = static_cast<double>(std::ranges::count(one.volume.samples, n + 1));
    const double was = one.labels == 1 ? voxels : before[n].extent.volume_mm3;
    largest = std::max(largest, std::abs(after[n].extent.volume_mm3 / was - 1));
  }
  return largest;
}

TEST(KeptVolume, IsThatOfTheVoxelsWithinABound) {
  for (const Case& one : cases()) {
    for (const double voxels : {0.5, 1.0, 2.0}) {
      SeparatingSurface surface = smoothed(one);
      const SimplificationEffect effect = simplify({.max_error_mm = voxels}, {}, surface);
      EXPECT_TRUE(effect.is_within) << one.name;
      EXPECT_LT(effect.triangles_after, effect.triangles_before / 3) << one.name;
      EXPECT_LE(largest_change(one, surface), 0.005) << one.name << ", " << voxels;
    }
  }
}

// Thin plates that touch each other, whose vertices are nearly all on junction curves and beside
// them, so that repairs move many back.
TEST(KeptVolume, IsThatOfThinLabels) {
  Case one = {"plates", test::constant<std::uint8_t>(0, {30, 30, 24}), 6};
  for (std::uint32_t k = 4; k < 20; ++k) {
    for (std::uint32_t j = 4; j < 26; ++j) {
      for (std::uint32_t i = 4; i < 26; ++i) {
        const double x = i - 15.0;
        const double y = j - 15.0;
        const double wave = k + 1.5 * std::sin(0.5 * x) + 1.5 * std::cos(0.4 * y);
        if (x * x + y * y > 110 || wave < 6 || wave >= 18) continue;
        one.volume.at(i, j, k) = static_cast<std::uint8_t>((wave - 6) / 2 + 1);
      }
    }
  }
  for (const double voxels : {0.5, 1.0, 2.0}) {
    SeparatingSurface surface = smoothed(one);
    EXPECT_TRUE(simplify({.max_error_mm = voxels}, {}, surface).is_within);
    EXPECT_LE(largest_change(one, surface), 0.003) << voxels;
  }
}

// Two labels that fill the volume. Caps stay flat, so the volume that bevelled edges lose could
// come back only with most of the triangles.
TEST(KeptVolume, TakesFewMoreTriangles) {
  Case one = {"halves", test::constant<std::uint8_t>(2, {40, 40, 32}), 2};
  for (std::uint32_t k = 0; k < 32; ++k) {
    for (std::uint32_t j = 0; j < 40; ++j) {
      for (std::uint32_t i = 0; i < 40; ++i) {
        if (k < 16 + 1.5 * std::sin(0.4 * i) + 1.5 * std::cos(0.35 * j)) one.volume.at(i, j, k) = 1;
      }
    }
  }
  for (const double voxels : {0.5, 1.0, 2.0}) {
    SeparatingSurface surface = smoothed(one);
    const SimplificationEffect effect = simplify({.max_error_mm = voxels}, {}, surface);
    EXPECT_TRUE(effect.is_within);
    SeparatingSurface unmoved = smoothed(one);
    const SimplificationEffect least =
        simplify({.max_error_mm = voxels, .keeps_volume = false}, {}, unmoved);
    EXPECT_LT(effect.triangles_after, 1.5 * static_cast<double>(least.triangles_after)) << voxels;
  }
}

TEST(KeptVolume, IsThatOfTheVoxelsAtATenthOfTheTriangles) {
  for (const Case& one : cases()) {
    SeparatingSurface surface = smoothed(one);
    const std::uint64_t aim = surface.mesh.triangles.size() / 10;
    const SimplificationEffect effect = simplify({.triangles = aim}, {}, surface);
    EXPECT_LE(effect.triangles_after, aim) << one.name;
    EXPECT_LE(find_self_intersections(surface.mesh, {}).pairs,
              find_self_intersections(smoothed(one).mesh, {}).pairs)
        << one.name;
    EXPECT_LE(largest_change(one, surface), 0.005) << one.name;
  }
}

TEST(KeptVolume, IsThatOfAnIsoSurface) {
  for (const double share : {0.1, 0.02}) {
    Mesh mesh = test::extracted(test::sample<float>(test::sphere({20, 20, 20}, 16), {41, 41, 41}),
                                {0, Scheme::kSix, Interpolation::kLinear, false});
    const double before = measure_extent(mesh, {}).volume_mm3;
    const auto aim = static_cast<std::uint64_t>(share * static_cast<double>(mesh.triangles.size()));
    simplify({.triangles = aim}, {}, mesh);
    EXPECT_LE(mesh.triangles.size(), aim);
    EXPECT_NEAR(measure_extent(mesh, {}).volume_mm3, before, 0.005 * before) << share;
  }
}

test::TriangleSoup wall_of(const SeparatingSurface& walls, const WallSides& sides) {
  test::TriangleSoup soup;
  for (std::size_t t = 0; t < walls.sides.size(); ++t) {
    if (walls.sides[t] != sides) continue;
    auto& corners = soup.triangles.emplace_back();
    for (std::size_t i = 0; i < 3; ++i) {
      const Vec3& p = walls.mesh.positions[walls.mesh.triangles[t][i]];
      corners[i] = {p[0], p[1], p[2]};
    }
  }
  return soup;
}

// By distances of other code. All walls around a label close its surface, so there is no gap.
TEST(KeptVolume, LeavesEachWallWithinTheBoundBothWaysAndEachLabelClosed) {
  constexpr std::size_t kLabels = 4;
  const Case one = {"blobs", label_cells(kLabels, {19, 18, 17}, 8, 5), kLabels};
  const SeparatingSurface before = smoothed(one);
  for (const double bound : {0.5, 1.0}) {
    SeparatingSurface after = smoothed(one);
    EXPECT_TRUE(simplify({.max_error_mm = bound}, {}, after).is_within);
    bool is_moved = false;
    for (const Vec3& position : after.mesh.positions) {
      is_moved = is_moved ||
                 std::ranges::find(before.mesh.positions, position) == before.mesh.positions.end();
    }
    EXPECT_TRUE(is_moved);
    for (PartNumber front = 0; front <= kLabels; ++front) {
      for (PartNumber back = front + 1; back <= kLabels; ++back) {
        const test::TriangleSoup was = wall_of(before, {front, back});
        const test::TriangleSoup is = wall_of(after, {front, back});
        ASSERT_EQ(was.triangles.empty(), is.triangles.empty());
        if (was.triangles.empty()) continue;
        EXPECT_LE(test::largest_distance(was, is, 1000, 1), bound);
        EXPECT_LE(test::largest_distance(is, was, 1000, 2), bound);
      }
    }
    for (std::size_t number = 1; number <= kLabels; ++number) {
      const Mesh label = label_mesh(after, number);
      EXPECT_EQ(measure_topology(label, {}), measure_topology(label_mesh(before, number), {}));
      EXPECT_TRUE(test::is_sound(test::surface_of(label))) << number;
    }
  }
}

TEST(KeptVolume, IsNotMadeUpForWhereVerticesAreToStay) {
  const Case one = cases().back();
  const SeparatingSurface before = smoothed(one);
  const std::set<Vec3> places(before.mesh.positions.begin(), before.mesh.positions.end());
  for (const double bound : {0.5, kUnbounded}) {
    SeparatingSurface after = smoothed(one);
    const std::uint64_t aim = bound < kUnbounded ? 0 : before.mesh.triangles.size() / 10;
    simplify({.max_error_mm = bound, .triangles = aim, .keeps_volume = false}, {}, after);
    EXPECT_LT(after.mesh.triangles.size(), before.mesh.triangles.size() / 3);
    EXPECT_TRUE(std::ranges::all_of(after.mesh.positions,
                                    [&](const Vec3& place) { return places.contains(place); }));
  }
}

TEST(KeptVolume, TurnsNoTriangleIntoANeedleWithoutArea) {
  Mesh mesh;
  mesh.positions.resize_for_overwrite(3);
  std::ranges::copy(std::vector<Vec3>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, mesh.positions.begin());
  const auto is_turned_at = [&](const Vec3& place) {
    return collapse::is_turned(mesh, std::vector<Vec3>{{0, 0, 0}, {1, 0, 0}, place}, {0, 1, 2});
  };
  EXPECT_FALSE(is_turned_at({0, 1, 0}));
  EXPECT_FALSE(is_turned_at({0.3F, 0.01F, 0}));
  EXPECT_TRUE(is_turned_at({0.3F, 0, 0}));
  EXPECT_TRUE(is_turned_at({0.3F, 1e-20F, 0}));
  EXPECT_TRUE(is_turned_at({0.3F, -0.5F, 0}));
}

// Flat surfaces lose no volume, so nothing there moves.
TEST(KeptVolume, MovesNothingOfABox) {
  auto volume = test::constant<std::uint8_t>(0, {20, 20, 20});
  for (std::uint32_t k = 5; k < 15; ++k) {
    for (std::uint32_t j = 5; j < 15; ++j) {
      for (std::uint32_t i = 5; i < 15; ++i) volume.at(i, j, k) = 1;
    }
  }
  SeparatingSurface box = separated(volume, {.labels = {1}, .close = true});
  const double before = label_measures(box)[0].extent.volume_mm3;
  simplify({.max_error_mm = 1e-3}, {}, box);
  EXPECT_NEAR(label_measures(box)[0].extent.volume_mm3, before, 1e-4 * before);
  for (const Vec3& p : box.mesh.positions) {
    // Vertices are half-way between samples.
    for (const float x : p) EXPECT_NEAR(std::round(2 * x), 2 * x, 1e-3);
  }
}

// Caps stay in the faces of the volume, and open surfaces keep their ends.
TEST(KeptVolume, LeavesCapsAndEndsWhereTheyAre) {
  Labels volume = ellipsoid({12, 12, 12});
  volume.dims.z /= 2;
  volume.samples.resize(std::size_t{volume.dims.x} * volume.dims.y * volume.dims.z);
  for (const bool close : {false, true}) {
    SeparatingSurface surface =
        separated(volume, {.labels = {1}, .close = close, .regularize = true});
    float highest = 0;
    for (const Vec3& p : surface.mesh.positions) highest = std::max(highest, p[2]);
    simplify({.triangles = surface.mesh.triangles.size() / 6}, {}, surface);
    std::size_t count = 0;
    for (const Vec3& p : surface.mesh.positions) {
      EXPECT_LE(p[2], highest);
      count += p[2] == highest ? 1 : 0;
    }
    EXPECT_GT(count, 8U);
  }
}

TEST(KeptVolume, IsTheSameOnAnyNumberOfThreads) {
  const Case one = {"blobs", label_cells(6, {44, 40, 42}, 12, 31), 6};
  for (const SimplifyOptions& options :
       {SimplifyOptions{.max_error_mm = 0.5}, SimplifyOptions{.triangles = 1500}}) {
    const auto make = [&] {
      SeparatingSurface surface = smoothed(one);
      simplify(options, {}, surface);
      return surface;
    };
    test::expect_same_on_any_threads(make, test::kSameBytes);
  }
}

}  // namespace
}  // namespace isomesh::mesh
