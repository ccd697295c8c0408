#include "server/mesh/measure/self_intersections.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/smooth/smooth.h"
#include "tests/support/any_threads.h"
#include "tests/support/errors.h"
#include "tests/support/heap.h"
#include "tests/support/kernels.h"
#include "tests/support/shapes.h"

namespace isomesh::mesh {
namespace {

using test::mesh_of;

std::uint64_t pairs_of(const std::vector<Vec3>& positions, const std::vector<Triangle>& triangles) {
  return find_self_intersections(mesh_of(positions, triangles), {}).pairs;
}

// Small whole coordinates, with which 64 bits compute all exactly.
using Whole = std::array<std::int64_t, 3>;

Whole whole_minus(const Whole& a, const Whole& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

Whole whole_cross(const Whole& a, const Whole& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

std::int64_t whole_dot(const Whole& a, const Whole& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

using WholeTriangle = std::array<Whole, 3>;

// Separating axes, all of them, exactly: normals, products of edges, and within one plane the
// edges' normals.
bool plainly_meet(const WholeTriangle& a, const WholeTriangle& b) {
  std::vector<Whole> axes;
  std::vector<Whole> normals;
  for (const WholeTriangle& t : {a, b}) {
    normals.push_back(whole_cross(whole_minus(t[1], t[0]), whole_minus(t[2], t[0])));
    for (std::size_t i = 0; i < 3; ++i) {
      axes.push_back(whole_cross(normals.back(), whole_minus(t[(i + 1) % 3], t[i])));
    }
  }
  axes.insert(axes.end(), normals.begin(), normals.end());
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      axes.push_back(
          whole_cross(whole_minus(a[(i + 1) % 3], a[i]), whole_minus(b[(j + 1) % 3], b[j])));
    }
  }
  return std::ranges::none_of(axes, [&](const Whole& axis) {
    const auto [a_low, a_high] =
        std::minmax({whole_dot(axis, a[0]), whole_dot(axis, a[1]), whole_dot(axis, a[2])});
    const auto [b_low, b_high] =
        std::minmax({whole_dot(axis, b[0]), whole_dot(axis, b[1]), whole_dot(axis, b[2])});
    return a_high < b_low || b_high < a_low;
  });
}

TEST(SelfIntersections, AreThoseThatAllPairsHave) {
  std::mt19937 random(11);
  for (const int extent : {6, 12, 40}) {
    std::uniform_int_distribution<int> place(0, extent);
    std::vector<WholeTriangle> wholes;
    std::vector<Vec3> positions;
    std::vector<Triangle> triangles;
    while (wholes.size() < 150) {
      WholeTriangle t;
      const Whole from = {place(random), place(random), place(random)};
      for (Whole& corner : t) {
        for (std::size_t axis = 0; axis < 3; ++axis) corner[axis] = from[axis] + place(random) % 7;
      }
      if (whole_cross(whole_minus(t[1], t[0]), whole_minus(t[2], t[0])) == Whole{0, 0, 0}) continue;
      const auto first = static_cast<std::uint32_t>(positions.size());
      for (const Whole& corner : t) {
        positions.push_back({static_cast<float>(corner[0]), static_cast<float>(corner[1]),
                             static_cast<float>(corner[2])});
      }
      triangles.push_back({first, first + 1, first + 2});
      wholes.push_back(t);
    }
    std::vector<std::array<std::uint32_t, 2>> expected;
    for (std::uint32_t a = 0; a < wholes.size(); ++a) {
      for (std::uint32_t b = a + 1; b < wholes.size(); ++b) {
        if (plainly_meet(wholes[a], wholes[b])) expected.push_back({a, b});
      }
    }
    ASSERT_FALSE(expected.empty());
    const SelfIntersections found = find_self_intersections(mesh_of(positions, triangles), {});
    EXPECT_EQ(found.pairs, expected.size()) << extent;
    ASSERT_EQ(found.places.size(), std::min<std::size_t>(expected.size(), 100));
    for (std::size_t n = 0; n < found.places.size(); ++n) {
      EXPECT_EQ(found.places[n].first, expected[n][0]);
      EXPECT_EQ(found.places[n].second, expected[n][1]);
    }
  }
}

const std::vector<Vec3> kCorner = {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}};

TEST(SelfIntersections, OfTwoTrianglesWithACommonVertexAreBeyondIt) {
  // On the other side of the vertex, in the plane and out of it.
  const auto with = [&](const Vec3& a, const Vec3& b) {
    std::vector<Vec3> positions = kCorner;
    positions.insert(positions.end(), {a, b});
    return pairs_of(positions, {{0, 1, 2}, {0, 3, 4}});
  };
  EXPECT_EQ(with({-4, 0, 0}, {0, -4, 0}), 0U);
  EXPECT_EQ(with({1, 1, 4}, {-1, -1, 4}), 0U);
  EXPECT_EQ(with({1, 1, 4}, {1, 1, -4}), 1U);    // cuts through the side
  EXPECT_EQ(with({8, 8, 4}, {8, 8, -4}), 1U);    // and through the far edge
  EXPECT_EQ(with({1, 1, 0}, {9, 9, 4}), 1U);     // touches the side with a corner
  EXPECT_EQ(with({2, 2, 0}, {9, 9, 4}), 1U);     // the far edge
  EXPECT_EQ(with({1, 0, 0}, {1, 0, 4}), 1U);     // an edge lies on an edge
  EXPECT_EQ(with({1, 1, 0}, {1, 2, 0}), 1U);     // within
  EXPECT_EQ(with({9, 1, 0}, {1, 9, 0}), 1U);     // around
  EXPECT_EQ(with({-4, 1, 0}, {-4, -4, 0}), 0U);  // beside, in one plane
}

TEST(SelfIntersections, OfTwoTrianglesWithACommonEdgeAreInOnePlane) {
  const auto with = [&](const Vec3& a) {
    std::vector<Vec3> positions = kCorner;
    positions.push_back(a);
    EXPECT_EQ(pairs_of(positions, {{0, 1, 2}, {0, 1, 3}}),
              pairs_of(positions, {{2, 0, 1}, {3, 1, 0}}));
    return pairs_of(positions, {{0, 1, 2}, {1, 0, 3}});
  };
  EXPECT_EQ(with({0, -4, 0}), 0U);
  EXPECT_EQ(with({0, 4, 1e-30F}), 0U);  // as narrow a fold as there is
  EXPECT_EQ(with({1, 1, 0}), 1U);
  EXPECT_EQ(with({0, 9, 0}), 1U);
}

TEST(SelfIntersections, OfATriangleTwiceIsOne) {
  EXPECT_EQ(pairs_of(kCorner, {{0, 1, 2}, {0, 1, 2}}), 1U);
  EXPECT_EQ(pairs_of(kCorner, {{0, 1, 2}, {1, 0, 2}}), 1U);
}

// Exactly at a touch, and next to it.
TEST(SelfIntersections, OfATouchIsDecidedExactly) {
  const auto with = [&](float z) {
    std::vector<Vec3> positions = kCorner;
    positions.insert(positions.end(), {{1, 1, z}, {2, 1, 5}, {1, 2, 5}});
    return pairs_of(positions, {{0, 1, 2}, {3, 4, 5}});
  };
  EXPECT_EQ(with(0), 1U);
  EXPECT_EQ(with(std::numeric_limits<float>::denorm_min()), 0U);
  EXPECT_EQ(with(-std::numeric_limits<float>::denorm_min()), 1U);
}

TEST(SelfIntersections, OfTrianglesWithoutAreaAreNone) {
  std::vector<Vec3> positions = kCorner;
  positions.insert(positions.end(), {{1, 1, -1}, {1, 1, 1}, {1, 1, 3}});
  EXPECT_EQ(pairs_of(positions, {{0, 1, 2}, {3, 4, 5}, {3, 3, 5}}), 0U);
}

// No sample has the iso-value: rounding alone might turn the tiny triangles around such a one.
TEST(SelfIntersections, OfExtractedSurfacesAreNone) {
  for (const Scheme scheme : {Scheme::kFive, Scheme::kSix}) {
    const Mesh mesh = test::extracted(test::sample<float>(test::gyroid(11), {24, 21, 22}),
                                      {0.1, scheme, Interpolation::kLinear, false});
    const SelfIntersections found = find_self_intersections(mesh, {});
    EXPECT_EQ(found.pairs, 0U);
    EXPECT_EQ(found.triangles, 0U);
    EXPECT_TRUE(found.places.empty());
  }
}

// A ball pushed through the other side of itself.
Mesh pierced_ball() {
  Mesh mesh = test::extracted(test::sample<float>(test::sphere({15, 15, 15}, 12.4), {31, 31, 31}),
                              {0, Scheme::kSix, Interpolation::kLinear, false});
  for (Vec3& at : mesh.positions) {
    if (std::hypot(at[0] - 15, at[1] - 15) < 4 && at[2] > 15) at[2] -= 27;
  }
  return mesh;
}

TEST(SelfIntersections, OfABallThatIsPushedThroughItselfAreARing) {
  const SelfIntersections found = find_self_intersections(pierced_ball(), {});
  EXPECT_GT(found.pairs, 20U);
  EXPECT_GT(found.triangles, 20U);
  EXPECT_LE(found.triangles, 2 * found.pairs);
  EXPECT_EQ(found.places.size(), std::min<std::uint64_t>(found.pairs, 100));
  for (const IntersectingPair& pair : found.places) {
    EXPECT_LT(pair.place[2], 9);
    EXPECT_LT(std::hypot(pair.place[0] - 15, pair.place[1] - 15), 9);
  }
}

TEST(SelfIntersections, AreTheSameOnAnyNumberOfThreads) {
  test::expect_same_on_any_threads([] {
    const auto [pairs, triangles, places] = find_self_intersections(pierced_ball(), {});
    return std::tuple(pairs, triangles, places);
  });
}

// Triangles that lie across each other, each with corners of its own.
Mesh tangle_of(std::size_t triangles, double extent) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> place(0, static_cast<float>(extent));
  std::uniform_real_distribution<float> way(-1, 1);
  std::vector<Vec3> positions;
  std::vector<Triangle> named;
  for (std::uint32_t t = 0; t < triangles; ++t) {
    const Vec3 from = {place(random), place(random), place(random)};
    for (int corner = 0; corner < 3; ++corner) {
      positions.push_back({from[0] + way(random), from[1] + way(random), from[2] + way(random)});
    }
    named.push_back({3 * t, 3 * t + 1, 3 * t + 2});
  }
  return mesh_of(positions, named);
}

// Cells with few triangles, and crowded ones, in several slabs.
TEST(SelfIntersections, OfCrowdsAreThoseThatAllPairsHave) {
  constexpr std::uint32_t kTriangles = 1200;
  for (const double extent : {1.0, 5.0, 16.0}) {
    const Mesh mesh = tangle_of(kTriangles, extent);
    const SurfaceView surface = mesh;
    std::uint64_t pairs = 0;
    std::vector<IntersectingPair> first;
    std::vector<bool> is_named(kTriangles);
    for (std::uint32_t a = 0; a < kTriangles; ++a) {
      for (std::uint32_t b = a + 1; b < kTriangles; ++b) {
        if (!intersect_each_other(surface, a, b)) continue;
        is_named[a] = is_named[b] = true;
        if (pairs++ < SelfIntersections::kMostPlaces) first.push_back({a, b, {}});
      }
    }
    const SelfIntersections found = find_self_intersections(surface, {});
    EXPECT_GT(pairs, SelfIntersections::kMostPlaces);
    EXPECT_EQ(found.pairs, pairs);
    EXPECT_EQ(found.triangles, static_cast<std::uint64_t>(std::ranges::count(is_named, true)));
    ASSERT_EQ(found.places.size(), first.size());
    for (std::size_t n = 0; n < first.size(); ++n) {
      EXPECT_EQ(found.places[n].first, first[n].first);
      EXPECT_EQ(found.places[n].second, first[n].second);
    }
    std::uint64_t even = 0;
    for (std::uint32_t a = 0; a < kTriangles; a += 2) {
      for (std::uint32_t b = a + 1; b < kTriangles; ++b)
        even += intersect_each_other(surface, a, b);
    }
    const auto is_even = [](std::uint32_t one, std::uint32_t) { return one % 2 == 0; };
    EXPECT_EQ(count_intersecting_pairs(surface, {}, is_even), even);
  }
}

TEST(SelfIntersections, TakeNoMemoryForPairs) {
  constexpr std::size_t kTriangles = 20'000;
  const Mesh mesh = tangle_of(kTriangles, 7);
  test::HeapPeak peak;
  const SelfIntersections found = find_self_intersections(mesh, {});
  const std::size_t bytes = peak.bytes();
  EXPECT_GT(found.pairs, 500'000U);
  EXPECT_LT(bytes, 200 * kTriangles);
}

TEST(SelfIntersections, OfNothingAreNone) {
  EXPECT_EQ(find_self_intersections(mesh_of({}, {}), {}).pairs, 0U);
}

TEST(SelfIntersections, StopWhenCancelled) {
  std::stop_source stop;
  stop.request_stop();
  const Context stopped = {stop.get_token(), {}};
  EXPECT_EQ(test::code_thrown_by([&] { find_self_intersections(pierced_ball(), stopped); }),
            ErrorCode::kCancelled);
}

}  // namespace
}  // namespace isomesh::mesh
