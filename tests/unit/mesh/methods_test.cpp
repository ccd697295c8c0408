// Tests that apply to every smoothing method in the table of methods that smooth() knows.
#include "server/mesh/smooth/methods.h"

#include <algorithm>
#include <cmath>
#include <stop_token>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/smooth/smooth.h"
#include "tests/support/any_threads.h"
#include "tests/support/errors.h"
#include "tests/support/kernels.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/points.h"
#include "tests/support/shapes.h"

namespace isomesh::mesh {
namespace {

using test::copy_of;
using test::method_options;

std::vector<Smoothing> all_of_smooth() {
  std::vector<Smoothing> all = values_of<Smoothing>();
  std::erase_if(all, [](Smoothing smoothing) { return method_of(smoothing).removes_stairs(); });
  return all;
}

SmoothOptions options_of(Smoothing method) { return method_options(method, 5); }

Mesh ball() {
  return test::extracted(test::sample<float>(test::sphere({7.33, 6.99, 7.27}, 5.2), {15, 15, 15}),
                         {});
}

Mesh noise(bool regularize, bool close) {
  return test::extracted(test::noise<std::uint8_t>({0, 1, 2, 3}, {40, 19, 34}, 31),
                         {.iso = 2, .close = close, .regularize = regularize});
}

TEST(MethodOf, FindsEachByItsName) {
  for (const SmoothingRow& row : kSmoothings) {
    EXPECT_EQ(method_of(row.smoothing).smoothing, row.smoothing);
    EXPECT_GT(method_of(row.smoothing).ms_per_triangle, 0);
  }
  EXPECT_GT(all_of_smooth().size(), 3U);
}

TEST(MethodOf, HasTheStepsOfAllPassesInOrder) {
  const auto steps = [](Smoothing smoothing, int passes) {
    return method_options(smoothing, passes).steps;
  };
  EXPECT_EQ(steps(Smoothing::kLaplacian, 3), test::means(3, {1}));
  EXPECT_EQ(steps(Smoothing::kTaubin, 2), test::means(2, {0.33, taubin_mu(0.33, 0.1)}));
  using enum Move;
  const auto moves = [&](int passes) {
    std::vector<Move> all;
    for (const Step& step : steps(Smoothing::kOptimize, passes)) all.push_back(step.move);
    return all;
  };
  EXPECT_EQ(moves(1), (std::vector{kLargestAngle}));
  EXPECT_EQ(moves(5), (std::vector{kTangentialMean, kTangentialMean, kLargestAngle, kLargestAngle,
                                   kLargestAngle}));
  EXPECT_EQ(moves(0), std::vector<Move>{});
}

class SmoothingMethods : public testing::TestWithParam<Smoothing> {};

TEST_P(SmoothingMethods, LeavesBoundariesAndCapsWhereTheyAre) {
  for (const bool close : {false, true}) {
    const Mesh before = noise(true, close);
    Mesh mesh = copy_of(before);
    smooth(options_of(GetParam()), {}, mesh);
    std::size_t moved = 0;
    for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
      if (mesh.is_on_border(v)) {
        ASSERT_EQ(mesh.positions[v], before.positions[v]);
      }
      moved += mesh.positions[v] != before.positions[v] ? 1 : 0;
    }
    EXPECT_GT(moved, mesh.positions.size() / 2);
    for (const auto& [from, to] : test::topology_of(test::surface_of(before)).boundary_edges) {
      ASSERT_EQ(mesh.positions[from], before.positions[from]);
      ASSERT_EQ(mesh.positions[to], before.positions[to]);
    }
    if (!method_of(GetParam()).is_unbounded()) {
      EXPECT_TRUE(test::is_sound(test::surface_of(mesh)));
    }
  }
}

TEST_P(SmoothingMethods, GivesTheSameBytesOnAnyNumberOfThreads) {
  const auto make = [] {
    Mesh mesh = noise(false, false);
    smooth(options_of(GetParam()), {}, mesh);
    return mesh;
  };
  test::expect_same_on_any_threads(make, test::kSameBytes);
}

TEST_P(SmoothingMethods, MovesNoVertexFartherThanIsAllowed) {
  const Mesh before = noise(false, false);
  for (const double most : {0.0, 0.05, 0.3}) {
    Mesh mesh = copy_of(before);
    SmoothOptions options = options_of(GetParam());
    options.max_displacement_mm = most;
    const SmoothingEffect effect = smooth(options, {}, mesh);
    double largest = 0;
    for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
      largest = std::max(largest, test::distance(mesh.positions[v], before.positions[v]));
    }
    EXPECT_LE(largest, most * (1 + 1e-12));
    EXPECT_NEAR(effect.max_displacement_mm, largest, 1e-9);
    EXPECT_GE(largest, most / 2);
  }
}

TEST_P(SmoothingMethods, TakesEmptyMeshesAndNoPasses) {
  Mesh empty = test::mesh_of({}, {});
  EXPECT_EQ(smooth(options_of(GetParam()), {}, empty).max_displacement_mm, 0);
  const Mesh before = ball();
  Mesh mesh = copy_of(before);
  smooth(method_options(GetParam(), 0), {}, mesh);
  EXPECT_TRUE(test::same_bytes(mesh, before));
}

TEST_P(SmoothingMethods, StopsWhenTheJobIsCancelled) {
  Mesh mesh = ball();
  std::stop_source stop;
  stop.request_stop();
  const Context context = {.stop = stop.get_token(), .progress = {}};
  EXPECT_EQ(test::code_thrown_by([&] { smooth(options_of(GetParam()), context, mesh); }),
            ErrorCode::kCancelled);
}

INSTANTIATE_TEST_SUITE_P(All, SmoothingMethods, testing::ValuesIn(all_of_smooth()),
                         [](const auto& method) { return std::string(to_string(method.param)); });

}  // namespace
}  // namespace isomesh::mesh
