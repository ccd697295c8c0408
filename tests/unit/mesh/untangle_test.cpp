// Surfaces that do not intersect themselves after smoothing.
#include "server/mesh/smooth/untangle.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <stop_token>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/measure/join_equal.h"
#include "server/mesh/measure/self_intersections.h"
#include "server/mesh/points.h"
#include "server/mesh/smooth/smooth.h"
#include "tests/support/any_threads.h"
#include "tests/support/errors.h"
#include "tests/support/heap.h"
#include "tests/support/kernels.h"
#include "tests/support/shapes.h"

namespace isomesh::mesh {
namespace {

using test::copy_of;
using test::method_options;

constexpr int kPasses = 20;

std::uint64_t pairs_of(const Mesh& mesh) { return find_self_intersections(mesh, {}).pairs; }

// What must hold for each vertex: it lies between its smoothed and its extracted position.
void expect_on_the_way(const Mesh& extracted, const Mesh& smoothed, const Mesh& mesh,
                       const UntangleEffect& effect) {
  ASSERT_EQ(mesh.positions.size(), smoothed.positions.size());
  EXPECT_TRUE(std::ranges::equal(mesh.triangles, smoothed.triangles));
  std::uint64_t moved = 0;
  double sum = 0;
  double largest = 0;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const Vec3& from = smoothed.positions[v];
    const Vec3& home = extracted.positions[v];
    const Vec3& at = mesh.positions[v];
    double squared = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto [low, high] = std::minmax(from[axis], home[axis]);
      ASSERT_TRUE(low <= at[axis] && at[axis] <= high) << v;
      squared += std::pow(double{at[axis]} - home[axis], 2);
    }
    // One share of the way for all axes, but for the rounding of the positions.
    const Point way = minus(to_point(from), to_point(home));
    const Point rest = minus(to_point(at), to_point(home));
    const Point off = cross(way, rest);
    EXPECT_LE(std::sqrt(dot(off, off)), 1e-4 * std::sqrt(dot(way, way))) << v;
    moved += at != from ? 1 : 0;
    sum += std::sqrt(squared);
    largest = std::max(largest, std::sqrt(squared));
  }
  EXPECT_EQ(effect.vertices, moved);
  EXPECT_LT(moved, mesh.positions.size());
  EXPECT_NEAR(effect.mean_displacement_mm, sum / static_cast<double>(mesh.positions.size()), 1e-6);
  EXPECT_NEAR(effect.max_displacement_mm, largest, 1e-6);
}

// Smooths and untangles; returns the number of pairs before.
std::uint64_t expect_untangled(const Mesh& extracted, const Mesh& smoothed) {
  const std::uint64_t before = pairs_of(smoothed);
  UntangleEffect effect;
  const Mesh mesh = test::expect_same_on_any_threads(
      [&] {
        Mesh its = copy_of(smoothed);
        effect = untangle({.extracted = extracted.positions.span()}, {}, its);
        return its;
      },
      [](const Mesh& one, const Mesh& other) {
        return std::ranges::equal(one.positions, other.positions);
      });
  EXPECT_EQ(effect.pairs, before);
  EXPECT_EQ(effect.left, 0U);
  EXPECT_EQ(pairs_of(mesh), 0U);
  expect_on_the_way(extracted, smoothed, mesh, effect);
  return before;
}

struct Way {
  Smoothing method;
  bool regularize;
  bool close;
};

class Untangle : public testing::TestWithParam<Way> {};

TEST_P(Untangle, LeavesNoIntersectionOfNoiseInAnyScheme) {
  const auto [method, regularize, close] = GetParam();
  for (const Scheme scheme : test::kSchemes) {
    std::uint64_t before = 0;
    for (const std::uint64_t seed : {1, 2, 3}) {
      const auto volume = test::noise_between<float>(-1, 1.5, {14, 13, 12}, seed);
      const Mesh extracted =
          test::extracted(volume, {.scheme = scheme, .close = close, .regularize = regularize});
      ASSERT_EQ(pairs_of(extracted), 0U);
      SmoothOptions options = method_options(method, kPasses);
      if (close) options.within = box_around(volume.lattice().to_space, volume.dims, 0);
      Mesh smoothed = copy_of(extracted);
      smooth(options, {}, smoothed);
      before += expect_untangled(extracted, smoothed);
    }
    EXPECT_GT(before, 0U) << static_cast<int>(scheme);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Methods, Untangle,
    testing::Values(Way{Smoothing::kLaplacian, false, false},
                    Way{Smoothing::kLaplacian, true, true}, Way{Smoothing::kTaubin, false, true},
                    Way{Smoothing::kTaubin, true, false}, Way{Smoothing::kAngle, false, false},
                    Way{Smoothing::kAngle, true, false}, Way{Smoothing::kOptimize, false, false},
                    Way{Smoothing::kOptimize, true, true}));

// Steps of a 1024th of a voxel, as files of few bits have them.
Vec3 rounded(const Vec3& position) {
  constexpr float kSteps = 1024;
  Vec3 result;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    result[axis] = std::round(kSteps * position[axis]) / kSteps;
  }
  return result;
}

std::uint64_t pairs_when_rounded(const Mesh& mesh) {
  Mesh its = copy_of(mesh);
  for (Vec3& position : its.positions) position = rounded(position);
  join_equal(its.positions.span(), its.triangles.span());
  return pairs_of(its);
}

TEST(UntangleRounded, LeavesOnlyWhatTheExtractedSurfaceHas) {
  std::uint64_t before = 0;
  std::uint64_t left = 0;
  for (const std::uint64_t seed : {1, 2, 3, 4}) {
    const auto volume = test::noise_between<float>(-1, 1.5, {14, 13, 12}, seed);
    const Mesh extracted = test::extracted(volume, {.regularize = true});
    Mesh smoothed = copy_of(extracted);
    smooth(method_options(Smoothing::kLaplacian, kPasses), {}, smoothed);
    for (const bool is_exact : {false, true}) {
      Mesh mesh = copy_of(smoothed);
      const UntangleOptions options = {.extracted = extracted.positions.span(),
                                       .is_exact = is_exact,
                                       .rounding = [](const Mesh&) {
                                         return Rounding{rounded, 1.0 / 2048};
                                       }};
      const UntangleEffect effect = untangle(options, {}, mesh);
      EXPECT_EQ(pairs_when_rounded(mesh), effect.left);
      EXPECT_GE(effect.pairs, pairs_when_rounded(smoothed));
      EXPECT_LE(effect.left, pairs_when_rounded(extracted));
      EXPECT_TRUE(!is_exact || pairs_of(mesh) == 0);
      expect_on_the_way(extracted, smoothed, mesh, effect);
      before += effect.pairs;
      left += effect.left;
    }
  }
  EXPECT_LT(4 * left, before);
}

// Two triangles through each other, as they were extracted, and a third that smoothing moved.
TEST(UntangleRest, IsWhatIntersectsAsExtracted) {
  const std::vector<Vec3> positions = {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {1, 1, -1}, {1, 1, 1},
                                       {2, 1, 1}, {9, 9, 9}, {9, 8, 9}, {8, 9, 9}};
  Mesh mesh = test::mesh_of(positions, {{0, 1, 2}, {3, 4, 5}, {6, 7, 8}});
  mesh.positions[8] = {8, 9, 8};
  const UntangleEffect effect = untangle({.extracted = positions}, {}, mesh);
  EXPECT_EQ(effect.pairs, 1U);
  EXPECT_EQ(effect.left, 1U);
  EXPECT_EQ(effect.vertices, 0U);
  EXPECT_EQ(effect.max_displacement_mm, 1);
  EXPECT_EQ(mesh.positions[8], (Vec3{8, 9, 8}));
}

// Smoothing has thrown all triangles into one heap.
TEST(UntangleMemory, IsBoundedHoweverManyTrianglesIntersect) {
  constexpr std::uint32_t kTriangles = 2500;
  std::mt19937 random(5);
  std::uniform_real_distribution<float> place(0, 7);
  std::vector<Vec3> extracted;
  std::vector<Vec3> smoothed;
  std::vector<Triangle> triangles;
  for (std::uint32_t t = 0; t < kTriangles; ++t) {
    const auto x = static_cast<float>(t);
    extracted.insert(extracted.end(), {{x, 0, 0}, {x, 1, 0}, {x, 0, 1}});
    for (int corner = 0; corner < 3; ++corner) {
      smoothed.push_back({place(random), place(random), place(random)});
    }
    triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
  }
  const std::uint64_t bound =
      untangling_memory({.triangles = kTriangles, .vertices = 3 * kTriangles});
  for (const bool rounds : {false, true}) {
    Mesh mesh = test::mesh_of(smoothed, triangles);
    UntangleOptions options = {.extracted = extracted};
    if (rounds) options.rounding = [](const Mesh&) { return Rounding{rounded, 1.0 / 2048}; };
    test::HeapPeak peak;
    const UntangleEffect effect = untangle(options, {}, mesh);
    EXPECT_LE(peak.bytes(), bound);
    EXPECT_GT(effect.pairs, 200'000U);
    EXPECT_EQ(effect.left, 0U);
    EXPECT_EQ(effect.vertices, 3 * kTriangles);
  }
}

TEST(UntangleRest, MayBeNothing) {
  Mesh mesh = test::mesh_of({}, {});
  EXPECT_EQ(untangle({}, {}, mesh).pairs, 0U);
}

TEST(UntangleRest, CanBeStopped) {
  std::stop_source stop;
  stop.request_stop();
  Mesh mesh = test::mesh_of({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}});
  const std::vector<Vec3> extracted(mesh.positions.begin(), mesh.positions.end());
  const Context context = {stop.get_token(), nullptr};
  EXPECT_EQ(test::code_thrown_by([&] { untangle({.extracted = extracted}, context, mesh); }),
            ErrorCode::kCancelled);
}

TEST(JoinEqual, NamesTheLowestVertexOfAPlaceThatIsNamed) {
  const std::vector<Vec3> positions = {{1, 2, 3},     {0, 0, 0}, {1, 2, 3}, {5, 5, 5},
                                       {-0.0F, 0, 0}, {1, 2, 3}, {5, 5, 6}};
  std::vector<Triangle> triangles = {{2, 4, 6}, {5, 3, 1}};
  join_equal(positions, triangles);
  EXPECT_EQ(triangles, (std::vector<Triangle>{{2, 1, 6}, {2, 3, 1}}));
}

}  // namespace
}  // namespace isomesh::mesh
