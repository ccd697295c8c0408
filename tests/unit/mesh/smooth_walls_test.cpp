// Smoothing of the walls between labels.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/smooth/smooth.h"
#include "tests/support/any_threads.h"
#include "tests/support/points.h"
#include "tests/support/step.h"
#include "tests/unit/mesh/separated.h"

namespace isomesh::mesh {
namespace {

using test::means;
using test::Point;

struct NamedWalls {
  std::string name;
  SeparatingSurface surface;
};

std::vector<NamedWalls> walls() {
  std::vector<NamedWalls> all;
  const auto add = [&](const std::string& name, const auto& volume, std::size_t labels) {
    for (SeparateOptions options : all_separations(consecutive<std::int64_t>(1, labels))) {
      all.push_back({name + ", " + describe(volume.dims, options), separated(volume, options)});
      options.regularize = true;
      all.push_back({"joined " + all.back().name, separated(volume, options)});
    }
  };
  add("noise", label_noise(6, {9, 7, 40}, 101), 5);
  add("cells", label_cells(12, {20, 13, 50}, 12, 102), 12);
  add("oblique", label_noise(3, {14, 12, 11}, 103, test::oblique_left_handed_geometry()), 2);
  return all;
}

// The vertices that each one moves by: of the edges of three triangles where there are such at it,
// else of all. None for one that stays.
std::vector<std::vector<std::uint32_t>> wall_neighbors(const SeparatingSurface& surface) {
  const Mesh& mesh = surface.mesh;
  std::map<std::array<std::uint32_t, 2>, int> edges;
  for (const auto& [a, b, c] : mesh.triangles) {
    for (const auto& [u, v] : {std::array{a, b}, std::array{b, c}, std::array{c, a}}) {
      ++edges[{std::min(u, v), std::max(u, v)}];
    }
  }
  std::vector<std::vector<std::uint32_t>> all(mesh.positions.size());
  std::vector<std::vector<std::uint32_t>> along_lines(mesh.positions.size());
  std::vector<bool> stays(mesh.positions.size(), false);
  for (const auto& [edge, triangles] : edges) {
    for (const std::size_t end : {0U, 1U}) {
      all[edge[end]].push_back(edge[1 - end]);
      if (triangles > 2) along_lines[edge[end]].push_back(edge[1 - end]);
      if (triangles == 1) stays[edge[end]] = true;
    }
  }
  for (std::size_t v = 0; v < all.size(); ++v) {
    if (!along_lines[v].empty()) all[v] = along_lines[v];
    if (!along_lines[v].empty() && along_lines[v].size() != 2) stays[v] = true;
    if (stays[v] || mesh.is_on_border(v)) all[v].clear();
  }
  return all;
}

std::vector<Point> points_of(const Mesh& mesh) { return test::surface_of(mesh).points; }

std::vector<Point> naively_smoothed(const SeparatingSurface& surface,
                                    const SmoothOptions& options) {
  const auto neighbors = wall_neighbors(surface);
  const std::vector<Point> extracted = points_of(surface.mesh);
  std::vector<Point> points = extracted;
  for (const Step& step : options.steps) {
    const std::vector<Point> last = points;
    for (std::size_t v = 0; v < points.size(); ++v) {
      if (neighbors[v].empty()) continue;
      Point mean = {0, 0, 0};
      for (const std::uint32_t n : neighbors[v]) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
          mean[axis] += last[n][axis] / static_cast<double>(neighbors[v].size());
        }
      }
      Point moved = test::between(last[v], mean, step.weight);
      const double way = test::length(test::minus(moved, extracted[v]));
      if (way > options.max_displacement_mm) {
        moved = test::between(extracted[v], moved, options.max_displacement_mm / way);
      }
      points[v] = moved;
    }
  }
  return points;
}

void smooth_walls(const SmoothOptions& options, SeparatingSurface& surface) {
  smooth(options, {}, surface.mesh);
}

class SmoothWalls : public testing::TestWithParam<SmoothOptions> {};

TEST_P(SmoothWalls, MovesVerticesAsTheNaiveWayDoes) {
  std::vector<NamedWalls> all = walls();
  for (std::size_t n = 0; n < all.size(); n += test::kStep) {
    auto& [name, surface] = all[n];
    SCOPED_TRACE(name);
    const std::vector<Point> before = points_of(surface.mesh);
    const std::vector<Point> expected = naively_smoothed(surface, GetParam());
    smooth_walls(GetParam(), surface);
    const std::vector<Point> points = points_of(surface.mesh);
    const std::vector<Triangle> triangles = test::surface_of(surface.mesh).triangles;
    const std::vector<bool> is_flat = test::corners_of_flat(expected, triangles);
    std::size_t moved_on_lines = 0;
    for (std::size_t v = 0; v < points.size(); ++v) {
      if (is_flat[v] && points[v] == before[v]) continue;
      ASSERT_LT(test::length(test::minus(points[v], expected[v])),
                1e-4 * static_cast<double>(1 + GetParam().steps.size()))
          << "vertex " << v << (surface.mesh.is_on_line(v) ? " on a line" : "");
      if (surface.mesh.is_on_line(v) && points[v] != before[v]) ++moved_on_lines;
    }
    EXPECT_GT(moved_on_lines, 10U);
  }
}

TEST_P(SmoothWalls, GivesTheSameBytesOnAnyNumberOfThreads) {
  const auto volume = label_cells(12, {30, 21, 90}, 12, 104);
  for (const SeparateOptions& options : all_separations(consecutive<std::int64_t>(1, 12))) {
    const auto make = [&] {
      SeparatingSurface surface = separated(volume, options);
      smooth_walls(GetParam(), surface);
      return surface;
    };
    test::expect_same_on_any_threads(make, test::kSameBytes);
  }
}

// A triangle by its positions, the smallest first.
using Place = std::array<Vec3, 3>;

Place place_of(const Mesh& mesh, const Triangle& triangle, bool turned) {
  Place place = {mesh.positions[triangle[0]], mesh.positions[triangle[turned ? 2 : 1]],
                 mesh.positions[triangle[turned ? 1 : 2]]};
  std::rotate(place.begin(), std::ranges::min_element(place), place.end());
  return place;
}

// A wall of two labels is in both of their own surfaces, turned over, to the bit.
TEST_P(SmoothWalls, LeavesWallsShared) {
  const auto volume = label_cells(8, {24, 20, 22}, 10, 106);
  for (const SeparateOptions& options : all_separations(consecutive<std::int64_t>(1, 8))) {
    SCOPED_TRACE(describe(volume.dims, options));
    SeparatingSurface surface = separated(volume, options);
    smooth_walls(GetParam(), surface);
    std::vector<std::multiset<Place>> own(surface.labels.size() + 1);
    std::vector<std::multiset<Place>> own_turned(own.size());
    for (std::size_t n = 1; n < own.size(); ++n) {
      const Mesh mesh = label_mesh(surface, n);
      for (const Triangle& triangle : mesh.triangles) {
        own[n].insert(place_of(mesh, triangle, false));
        own_turned[n].insert(place_of(mesh, triangle, true));
      }
    }
    std::size_t shared = 0;
    for (std::size_t t = 0; t < surface.sides.size(); ++t) {
      const auto& [front, back] = surface.sides[t];
      const Place place = place_of(surface.mesh, surface.mesh.triangles[t], false);
      ASSERT_TRUE(own[back].contains(place));
      if (front == 0) continue;
      ASSERT_TRUE(own_turned[front].contains(place));
      ++shared;
    }
    EXPECT_GT(shared, 100U);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Passes, SmoothWalls,
    testing::Values(SmoothOptions{means(1, {1})}, SmoothOptions{means(5, {0.6})},
                    SmoothOptions{.steps = means(10, {1}), .max_displacement_mm = 0.5},
                    SmoothOptions{means(9, {0.33, -0.34})}, SmoothOptions{means(14, {0.6, -0.64})},
                    SmoothOptions{.steps = means(3, {0.6, -0.64}), .max_displacement_mm = 0.05}));

TEST(SmoothWallsWithin, MovesNoVertexFarther) {
  for (auto& [name, surface] : walls()) {
    SCOPED_TRACE(name);
    const std::vector<Point> before = points_of(surface.mesh);
    const double limit = 0.2;
    const SmoothingEffect effect =
        smooth({.steps = means(10, {1}), .max_displacement_mm = limit}, {}, surface.mesh);
    const std::vector<Point> after = points_of(surface.mesh);
    double largest = 0;
    for (std::size_t v = 0; v < before.size(); ++v) {
      largest = std::max(largest, test::length(test::minus(after[v], before[v])));
    }
    EXPECT_LE(largest, limit * (1 + 1e-12));
    EXPECT_NEAR(effect.max_displacement_mm, largest, 1e-9);
    EXPECT_GT(largest, 0.99 * limit);
  }
}

// Smoothed positions of the vertices that were strictly inside the box of the samples.
std::vector<Vec3> inner_smoothed(const test::SampleVolume<std::uint8_t>& volume,
                                 const SeparateOptions& options, const SmoothOptions& smoothing) {
  SeparatingSurface surface = separated(volume, options);
  const std::array<std::uint32_t, 3> counts = {volume.dims.x, volume.dims.y, volume.dims.z};
  std::vector<bool> is_inner(surface.mesh.positions.size(), true);
  for (std::size_t v = 0; v < is_inner.size(); ++v) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float at = surface.mesh.positions[v][axis];
      if (at <= 0 || at >= static_cast<float>(counts[axis] - 1)) is_inner[v] = false;
    }
    if (!options.close) continue;
    EXPECT_EQ(surface.mesh.is_on_border(v), !is_inner[v]);
  }
  smooth_walls(smoothing, surface);
  std::vector<Vec3> inner;
  for (std::size_t v = 0; v < is_inner.size(); ++v) {
    if (is_inner[v]) inner.push_back(surface.mesh.positions[v]);
  }
  return inner;
}

TEST(SmoothWallsBorder, ClosingDoesNotChangeTheRest) {
  const auto volume = label_cells(12, {40, 21, 30}, 12, 107);
  const auto labels = consecutive<std::int64_t>(1, 12);
  for (const Scheme scheme : {Scheme::kFive, Scheme::kSix}) {
    for (const SmoothOptions& options :
         {SmoothOptions{means(7, {1})},
          SmoothOptions{.steps = means(5, {0.6, -0.64}), .max_displacement_mm = 0.2}}) {
      const auto open = inner_smoothed(volume, {labels, scheme, false}, options);
      EXPECT_GT(open.size(), 1000U);
      EXPECT_EQ(inner_smoothed(volume, {labels, scheme, true}, options), open);
    }
  }
}

TEST(SmoothWallsShape, TwoLabelsAreSmoothedAsAnIsosurfaceIs) {
  const auto volume = test::noise<std::uint8_t>({0, 1}, {20, 17, 60}, 105);
  for (const Scheme scheme : {Scheme::kFive, Scheme::kSix}) {
    Mesh mesh = test::extracted(volume, {1, scheme, Interpolation::kMidpoint});
    SeparatingSurface surface = separated(volume, {{1}, scheme});
    smooth({means(7, {0.7})}, {}, mesh);
    smooth({means(7, {0.7})}, {}, surface.mesh);
    EXPECT_TRUE(test::same_bytes(surface.mesh, mesh));
  }
}

// A corner may be moved by about its rounding if its triangle's corners lie on curves and in line.
bool is_where_it_was(const Vec3& after, const Vec3& before) {
  constexpr float kLargest = 64;  // coordinate of these volumes
  return std::ranges::equal(
      after, before, [](float a, float b) { return std::abs(a - b) <= kLargest * 0x1p-22F; });
}

TEST(SmoothWalls, MeansLeaveJunctionCurvesWhereTheyAreIfAsked) {
  for (auto& [name, surface] : walls()) {
    SCOPED_TRACE(name);
    Mesh& mesh = surface.mesh;
    const std::vector<Vec3> before(mesh.positions.begin(), mesh.positions.end());
    smooth({.steps = means(3, {1}), .at_curves = AtCurves::kStay}, {}, mesh);
    std::size_t moved = 0;
    for (std::size_t v = 0; v < before.size(); ++v) {
      if (mesh.is_on_line(v)) {
        ASSERT_TRUE(is_where_it_was(mesh.positions[v], before[v]));
      }
      moved += mesh.positions[v] != before[v] ? 1 : 0;
    }
    EXPECT_GT(moved, 0);
  }
}

TEST(SmoothWalls, LargerAnglesLeaveJunctionCurvesWhereTheyAre) {
  for (const Smoothing method : {Smoothing::kAngle, Smoothing::kOptimize}) {
    for (auto& [name, surface] : walls()) {
      SCOPED_TRACE(name);
      Mesh& mesh = surface.mesh;
      const std::vector<Vec3> before(mesh.positions.begin(), mesh.positions.end());
      SmoothOptions options = test::method_options(method, 5);
      options.max_displacement_mm = 0.5;
      const SmoothingEffect effect = smooth(options, {}, mesh);
      std::size_t moved = 0;
      for (std::size_t v = 0; v < before.size(); ++v) {
        if (mesh.is_on_border(v)) {
          ASSERT_EQ(mesh.positions[v], before[v]);
        }
        if (mesh.is_on_line(v)) {
          ASSERT_TRUE(is_where_it_was(mesh.positions[v], before[v]));
        }
        moved += mesh.positions[v] != before[v] ? 1 : 0;
      }
      EXPECT_GT(moved, 0);
      EXPECT_GT(effect.max_displacement_mm, 0);
      EXPECT_LE(effect.max_displacement_mm, 0.5);
    }
  }
}

}  // namespace
}  // namespace isomesh::mesh
