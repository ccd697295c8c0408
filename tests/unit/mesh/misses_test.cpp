#include "server/mesh/collapse/misses.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/collapse/simplify.h"
#include "server/mesh/measure/self_intersections.h"
#include "server/mesh/smooth/smooth.h"
#include "tests/support/any_threads.h"
#include "tests/support/exact_distance.h"
#include "tests/support/step.h"
#include "tests/unit/mesh/separated.h"

namespace isomesh::mesh {
namespace {

struct Surface {
  std::vector<Vec3> positions;
  std::vector<Triangle> triangles;
  std::vector<WallSides> sides = {};

  WalledSurface walled() const { return {{positions, triangles}, sides}; }
};

std::vector<Miss> misses(const Surface& from, const Surface& to, double within_mm) {
  const auto all = consecutive<std::uint32_t>(0, from.triangles.size());
  return find_misses(from.walled(), all, {to.walled(), {}}, within_mm, {});
}

// A square between its corners, at a height, cut into so many by so many squares of two triangles.
Surface square(std::uint32_t cuts, float height) {
  Surface surface;
  for (std::uint32_t y = 0; y <= cuts; ++y) {
    for (std::uint32_t x = 0; x <= cuts; ++x) {
      surface.positions.push_back({10.0F * static_cast<float>(x) / static_cast<float>(cuts),
                                   10.0F * static_cast<float>(y) / static_cast<float>(cuts),
                                   height});
      if (x == cuts || y == cuts) continue;
      const std::uint32_t a = y * (cuts + 1) + x;
      surface.triangles.push_back({a, a + 1, a + cuts + 1});
      surface.triangles.push_back({a + 1, a + cuts + 2, a + cuts + 1});
    }
  }
  return surface;
}

TEST(Misses, OfSurfacesSideBySideDependOnTheirDistanceAlone) {
  for (const std::uint32_t cuts : {1U, 3U, 16U}) {
    const Surface low = square(cuts, 0);
    const Surface high = square(7, 0.5F);
    EXPECT_TRUE(misses(low, high, 0.5001).empty());
    EXPECT_TRUE(misses(high, low, 0.5001).empty());
    EXPECT_EQ(misses(low, high, 0.4999).size(), low.triangles.size());
    EXPECT_EQ(misses(high, low, 0.4999).size(), high.triangles.size());
  }
}

// The scale of an electron micrograph, in millimetres, or closer than single precision tells places
// apart.
TEST(Misses, OfTheSmallestSurfacesAreFoundAsWell) {
  const auto scaled = [](Surface surface, float scale) {
    for (Vec3& position : surface.positions) {
      for (float& coordinate : position) coordinate *= scale;
    }
    return surface;
  };
  for (const float scale : {1e-4F, 1e-7F, 1e-9F}) {
    const Surface low = scaled(square(3, 0), scale);
    const Surface high = scaled(square(7, 0.5F), scale);
    EXPECT_TRUE(misses(low, high, 0.5001 * double{scale}).empty());
    EXPECT_EQ(misses(low, high, 0.4999 * double{scale}).size(), low.triangles.size());
    EXPECT_EQ(misses(low, high, 0.05 * double{scale}).size(), low.triangles.size());
  }
  EXPECT_EQ(misses(square(3, 0), square(7, 5e-8F), 1e-8).size(), 18U);
}

// No vertex and no centre of a triangle is far from the other surface.
TEST(Misses, AreFoundBetweenAllThatIsMeasured) {
  const Surface flat = square(1, 0);
  Surface spike = square(10, 0);
  const std::uint32_t top = 3 * 11 + 4;  // at (4, 3), of no vertex and no centre of the other
  spike.positions[top][2] = 0.3F;
  EXPECT_TRUE(misses(spike, flat, 0.31).empty());
  const std::vector<Miss> found = misses(spike, flat, 0.29);
  EXPECT_EQ(found.size(), 6U);  // all around the spike, none of which has its centre so high
  for (const Miss& miss : found) {
    EXPECT_EQ(std::ranges::count(spike.triangles[miss.triangle], top), 1);
    EXPECT_GT(miss.place[2], 0.25);
  }
}

TEST(Misses, OfAWallCountFromThatWallAlone) {
  Surface low = square(2, 0);
  Surface high = square(3, 0.1F);
  low.sides.assign(low.triangles.size(), {1, 2});
  high.sides.assign(high.triangles.size(), {1, 2});
  EXPECT_TRUE(misses(low, high, 0.2).empty());
  low.sides[5] = {0, 2};
  const std::vector<Miss> found = misses(low, high, 0.2);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found.front().triangle, 5U);
  EXPECT_FALSE(misses(high, low, 0.2).empty());  // those over the triangle of another wall
}

test::TriangleSoup soup_of(const Surface& surface) {
  test::TriangleSoup soup;
  for (const auto& [a, b, c] : surface.triangles) {
    const auto corner = [&](std::uint32_t v) {
      const Vec3& p = surface.positions[v];
      return std::array<double, 3>{p[0], p[1], p[2]};
    };
    soup.triangles.push_back({corner(a), corner(b), corner(c)});
  }
  return soup;
}

TEST(Misses, AgreeWithManyDistancesOfOtherCode) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> height(-0.4F, 0.4F);
  std::size_t missed = 0;
  for (std::uint32_t i = 0; i < 60; ++i) {
    Surface from = square(1 + i % 5, 0);
    Surface to = square(1 + i % 3, 0);
    for (Vec3& p : from.positions) p[2] = height(random);
    for (Vec3& p : to.positions) p[2] = height(random);
    const double within = 0.3 + 0.01 * (i % 30);
    const std::vector<Miss> found = misses(from, to, within);
    const test::TriangleSoup other = soup_of(to);
    if (found.empty()) {
      EXPECT_LE(test::largest_distance(soup_of(from), other, 4000, i), within);
    }
    for (const Miss& miss : found) {
      EXPECT_GT(test::distance_to(miss.place, other), 0.997 * within);
      ++missed;
    }
  }
  EXPECT_GT(missed, 20U);
}

// Each wall is within the error of itself at points of other code, and no triangle goes through
// another one.
TEST(Misses, AreNoneOfSimplifiedWalls) {
  constexpr double kError = 0.2;
  const auto volume = label_cells(5, {13, 12, 11}, 9, 31);
  const auto all = all_separations(consecutive<std::int64_t>(1, 4));
  for (std::size_t n = 0; n < all.size(); n += test::kStep) {
    const SeparateOptions& options = all[n];
    const SeparatingSurface original = separated(volume, options);
    SeparatingSurface surface = separated(volume, options);
    smooth({.steps = test::means(5, {0.5}), .max_displacement_mm = kError / 2}, {}, surface.mesh);
    const std::uint64_t crossing = find_self_intersections(surface.mesh, {}).pairs;
    const SimplificationEffect effect =
        simplify({.max_error_mm = kError, .before = original.mesh.positions.span()}, {}, surface);
    EXPECT_TRUE(effect.is_within);
    EXPECT_LT(effect.triangles_after, 3 * effect.triangles_before / 4);
    EXPECT_LE(find_self_intersections(surface.mesh, {}).pairs, crossing);
    for (std::uint16_t front = 0; front < 5; ++front) {
      for (std::uint16_t back = front + 1; back < 5; ++back) {
        const auto wall_of = [&](const SeparatingSurface& walls) {
          Surface wall;
          wall.positions.assign(walls.mesh.positions.begin(), walls.mesh.positions.end());
          for (std::size_t t = 0; t < walls.sides.size(); ++t) {
            if (walls.sides[t] == WallSides{front, back}) {
              wall.triangles.push_back(walls.mesh.triangles[t]);
            }
          }
          return soup_of(wall);
        };
        const test::TriangleSoup before = wall_of(original);
        const test::TriangleSoup after = wall_of(surface);
        ASSERT_EQ(before.triangles.empty(), after.triangles.empty());
        if (before.triangles.empty()) continue;
        EXPECT_LE(test::largest_distance(before, after, 1000, 1), kError);
        EXPECT_LE(test::largest_distance(after, before, 1000, 2), kError);
      }
    }
  }
}

}  // namespace
}  // namespace isomesh::mesh
