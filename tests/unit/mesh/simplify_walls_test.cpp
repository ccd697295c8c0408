// Simplified walls between labels.
#include <algorithm>
#include <bit>
#include <cstdint>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/collapse/proposal.h"
#include "server/mesh/collapse/simplify.h"
#include "server/mesh/collapse/simplify_layers.h"
#include "server/mesh/labels/label_surface.h"
#include "server/mesh/measure/distance.h"
#include "server/mesh/smooth/smooth.h"
#include "tests/support/any_threads.h"
#include "tests/unit/mesh/separated.h"

namespace isomesh::mesh {
namespace {

// Cells of labels, smoothed.
SeparatingSurface smooth_cells(std::size_t count, const SeparateOptions& options) {
  SeparatingSurface surface = separated(label_cells(count, {44, 40, 42}, 9, 31), options);
  smooth({.steps = test::means(5, {0.5})}, {}, surface.mesh);
  return surface;
}

TEST(SimplifyWalls, KeepEveryLabelsSurfaceOfItsKindAndWithinTheError) {
  constexpr std::size_t kCount = 7;
  constexpr double kError = 0.15;
  for (const SeparateOptions& options : all_separations(consecutive<std::int64_t>(1, kCount - 1))) {
    const SeparatingSurface original = smooth_cells(kCount, options);
    SeparatingSurface surface = smooth_cells(kCount, options);
    const SimplificationEffect effect = simplify({.max_error_mm = kError}, {}, surface);
    EXPECT_LT(effect.triangles_after, effect.triangles_before / 2);
    ASSERT_EQ(surface.sides.size(), surface.mesh.triangles.size());
    EXPECT_LE(certify(surface.mesh, original.mesh, {}).max_mm(), kError);
    for (std::size_t number = 1; number < kCount; ++number) {
      const Mesh before = label_mesh(original, number);
      const Mesh after = label_mesh(surface, number);
      EXPECT_EQ(measure_topology(after, {}), measure_topology(before, {})) << number;
      EXPECT_TRUE(test::is_sound(test::surface_of(after))) << number;
      EXPECT_LT(after.triangles.size(), before.triangles.size()) << number;
      EXPECT_LE(certify(after, before, {}).max_mm(), kError) << number;
    }
  }
}

std::size_t count_on_line(const Mesh& mesh) {
  std::size_t count = 0;
  for (const std::uint64_t word : mesh.on_line)
    count += static_cast<std::size_t>(std::popcount(word));
  return count;
}

// Two blocks side by side meet in a rectangle: of its edges a few vertices are enough.
TEST(SimplifyWalls, LeaveFewVerticesOnStraightLines) {
  auto blocks = test::constant<std::uint8_t>(0, {24, 24, 24});
  for (std::uint32_t k = 4; k < 20; ++k) {
    for (std::uint32_t j = 4; j < 20; ++j) {
      for (std::uint32_t i = 4; i < 20; ++i) blocks.at(i, j, k) = i < 12 ? 1 : 2;
    }
  }
  SeparatingSurface surface = separated(blocks, {.labels = {1, 2}});
  const std::size_t before = count_on_line(surface.mesh);
  simplify({.max_error_mm = 0.9}, {}, surface);
  EXPECT_LT(count_on_line(surface.mesh), before / 4);
}

// A value that belongs to two labels: walls between what overlaps and what does not.
TEST(SimplifyWalls, KeepLabelsThatOverlap) {
  SeparateOptions options = {.labels = {1, 2, 3}, .close = true};
  options.values = {{2, {2, 4}}, {3, {3, 4, 5}}};
  const SeparatingSurface original = smooth_cells(6, options);
  SeparatingSurface surface = smooth_cells(6, options);
  simplify({.max_error_mm = 0.2}, {}, surface);
  EXPECT_LT(surface.mesh.triangles.size(), original.mesh.triangles.size() / 2);
  for (std::size_t number = 1; number <= options.labels.size(); ++number) {
    const Mesh before = label_mesh(original, number);
    const Mesh after = label_mesh(surface, number);
    EXPECT_EQ(measure_topology(after, {}), measure_topology(before, {})) << number;
    EXPECT_TRUE(test::is_sound(test::surface_of(after))) << number;
  }
}

TEST(SimplifyWalls, ReachANumberOfTriangles) {
  const SeparateOptions options = {.labels = {1, 2, 3}, .close = true};
  SeparatingSurface surface = smooth_cells(4, options);
  const std::uint64_t aim = surface.mesh.triangles.size() / 3;
  const SimplificationEffect effect = simplify({.triangles = aim}, {}, surface);
  EXPECT_TRUE(effect.reached_triangles);
  EXPECT_LE(surface.mesh.triangles.size(), aim);
  EXPECT_EQ(surface.sides.size(), surface.mesh.triangles.size());
}

TEST(SimplifyWalls, LeaveEachLabelASurfaceWhateverTheNumber) {
  const SeparateOptions options = {.labels = {1, 2, 3}, .close = true};
  const SeparatingSurface original = smooth_cells(4, options);
  for (const std::uint64_t aim : {1, 4, 7, 10, 20, 50, 100}) {
    SCOPED_TRACE(aim);
    SeparatingSurface surface = smooth_cells(4, options);
    const SimplificationEffect effect = simplify({.triangles = aim}, {}, surface);
    EXPECT_EQ(effect.reached_triangles, surface.mesh.triangles.size() <= aim);
    EXPECT_EQ(effect.is_least, !effect.reached_triangles);
    for (std::size_t number = 1; number <= 3; ++number) {
      const Mesh after = label_mesh(surface, number);
      EXPECT_EQ(measure_topology(after, {}), measure_topology(label_mesh(original, number), {}));
      std::vector<Triangle> triangles(after.triangles.begin(), after.triangles.end());
      for (Triangle& triangle : triangles) std::ranges::sort(triangle);
      std::ranges::sort(triangles);
      EXPECT_TRUE(std::ranges::adjacent_find(triangles) == triangles.end()) << number;
    }
  }
}

// Returns how many triangles are left.
std::size_t take_what_is_left(const collapse::History& history, SeparatingSurface& surface) {
  std::vector<Triangle> triangles;
  std::vector<WallSides> sides;
  for (std::size_t t = 0; t < surface.sides.size(); ++t) {
    const Triangle corners = history.corners_of(surface.mesh.triangles[t]);
    const auto& [a, b, c] = corners;
    if (a == b || b == c || c == a) continue;
    triangles.push_back(corners);
    sides.push_back(surface.sides[t]);
  }
  replace_triangles(triangles, sides, surface.mesh);
  surface.sides.shrink(sides.size());
  std::ranges::copy(sides, surface.sides.begin());
  return sides.size();
}

TEST(SimplifyWalls, StayOfTheirKindWhateverCollapsesAreUndone) {
  const SeparateOptions options = {.labels = {1, 2, 3}, .close = true};
  const SeparatingSurface original = smooth_cells(4, options);
  const WalledSurface walled = {original.mesh, original.sides.span()};
  const WallGrids grids(walled, {});
  const Original measured = {walled, &grids};
  Proposal proposal = propose({.max_error_mm = 0.3}, {}, original.mesh, &original, measured);
  std::size_t left = proposal.triangles.size();
  EXPECT_LT(left, original.sides.size() / 3);
  for (std::uint32_t round = 0; round < 8; ++round) {
    std::vector<std::uint32_t> which;
    for (std::uint32_t t = round; t < original.sides.size(); t += 1000) which.push_back(t);
    const std::vector<std::uint32_t> changed =
        proposal.history.undo(original.mesh.triangles.span(), which, 1 + round);
    EXPECT_TRUE(std::ranges::is_sorted(changed));
    SeparatingSurface surface = smooth_cells(4, options);
    const std::size_t before = std::exchange(left, take_what_is_left(proposal.history, surface));
    EXPECT_GT(left, before);
    for (std::size_t number = 1; number <= 3; ++number) {
      const Mesh label = label_mesh(surface, number);
      EXPECT_EQ(measure_topology(label, {}), measure_topology(label_mesh(original, number), {}));
      EXPECT_TRUE(test::is_sound(test::surface_of(label))) << number;
    }
  }
  EXPECT_LT(left, original.sides.size());
  const auto all = consecutive<std::uint32_t>(0, original.sides.size());
  proposal.history.undo(original.mesh.triangles.span(), all, 1000);
  for (const Triangle& triangle : original.mesh.triangles) {
    ASSERT_EQ(proposal.history.corners_of(triangle), triangle);
  }
}

TEST(SimplifyWalls, AreTheSameOnAnyNumberOfThreads) {
  const SeparateOptions options = {.labels = {1, 2, 3}, .close = true};
  const auto make = [&] {
    SeparatingSurface surface = smooth_cells(4, options);
    simplify({.max_error_mm = 0.1}, {}, surface);
    return surface;
  };
  test::expect_same_on_any_threads(make, test::kSameBytes);
}

}  // namespace
}  // namespace isomesh::mesh
