#include "server/mesh/smooth/smooth.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/any_threads.h"
#include "tests/support/errors.h"
#include "tests/support/kernels.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/nifti.h"
#include "tests/support/points.h"
#include "tests/support/shapes.h"

namespace isomesh::mesh {
namespace {

using test::copy_of;
using test::means;
using test::Surface;

struct NamedMesh {
  std::string name;
  Mesh mesh;
};

Mesh closed_ball() {
  return test::extracted(test::sample<float>(test::sphere({10.2, 9.8, 10.4}, 7.3), {21, 21, 22}),
                         {});
}

Mesh open_plane() {
  const test::Field field = test::plane({2.0 / 7, 3.0 / 7, 6.0 / 7}, 9);
  return test::extracted(test::sample<float>(field, {20, 18, 16}),
                         {0, Scheme::kFive, Interpolation::kMidpoint});
}

// Many components, handles and boundary loops, and vertices of every valence.
Mesh open_noise() {
  return test::extracted(test::noise<std::uint8_t>({0, 1, 2, 3}, {40, 19, 70}, 31),
                         {2, Scheme::kSix, Interpolation::kLinear});
}

Mesh oblique_noise() {
  const auto volume =
      test::noise<std::int16_t>({-5, 1, 4}, {18, 17, 16}, 32, test::oblique_left_handed_geometry());
  return test::extracted(volume, {0, Scheme::kFive, Interpolation::kLinear});
}

// Components around single samples, some of which equal the iso-value.
Mesh specks(Scheme scheme) {
  const auto volume = test::noise<std::uint8_t>({0, 1, 60, 61, 200}, {11, 13, 70}, 31);
  return test::extracted(volume, {60, scheme, Interpolation::kLinear});
}

std::vector<NamedMesh> meshes() {
  std::vector<NamedMesh> result;
  result.push_back({"closed ball", closed_ball()});
  result.push_back({"open plane", open_plane()});
  result.push_back({"open noise", open_noise()});
  result.push_back({"oblique noise", oblique_noise()});
  result.push_back({"specks", specks(Scheme::kFive)});
  return result;
}

Mesh smoothed(const Mesh& mesh, const SmoothOptions& options) {
  Mesh result = copy_of(mesh);
  smooth(options, {}, result);
  return result;
}

Surface naively_smoothed(const Mesh& mesh, const SmoothOptions& options) {
  std::vector<double> shares;
  for (const Step& step : options.steps) shares.push_back(step.weight);
  return test::naively_smoothed(test::surface_of(mesh), shares);
}

// The farthest that a point lies from where the naive way moves it. Corners of triangles without
// area may be where they were extracted instead.
double largest_error(const Mesh& extracted, const Mesh& moved, const SmoothOptions& options) {
  const Surface before = test::surface_of(extracted);
  const Surface after = test::surface_of(moved);
  const Surface expected = naively_smoothed(extracted, options);
  const std::vector<bool> is_flat = test::corners_of_flat(expected.points, expected.triangles);
  double largest = 0;
  for (std::size_t v = 0; v < after.points.size(); ++v) {
    if (is_flat[v] && after.points[v] == before.points[v]) continue;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      largest = std::max(largest, std::abs(after.points[v][axis] - expected.points[v][axis]));
    }
  }
  return largest;
}

class Smooth : public testing::TestWithParam<SmoothOptions> {};

// Means put all corners of an octahedron on one point.
TEST_P(Smooth, LeavesNoTriangleWithoutArea) {
  for (const Scheme scheme : {Scheme::kFive, Scheme::kSix, Scheme::kBcc}) {
    const Mesh mesh = specks(scheme);
    for (const int threads : {1, 2, 16}) {
      const test::ThreadCount several(threads);
      EXPECT_TRUE(test::is_sound(test::surface_of(smoothed(mesh, GetParam()))))
          << threads << " threads, scheme " << static_cast<int>(scheme);
    }
  }
}

TEST_P(Smooth, MovesVerticesAsTheNaiveWayDoes) {
  for (const auto& [name, mesh] : meshes()) {
    SCOPED_TRACE(name);
    const Mesh result = smoothed(mesh, GetParam());
    EXPECT_TRUE(std::ranges::equal(result.triangles, mesh.triangles));
    // A few roundings of a coordinate of about a hundred for each pass.
    EXPECT_LT(largest_error(mesh, result, GetParam()),
              3e-5 * static_cast<double>(1 + GetParam().steps.size()));
  }
}

TEST_P(Smooth, LeavesBoundaryVerticesWhereTheyAre) {
  for (const auto& [name, mesh] : meshes()) {
    SCOPED_TRACE(name);
    const Mesh result = smoothed(mesh, GetParam());
    for (const auto& [from, to] : test::topology_of(test::surface_of(mesh)).boundary_edges) {
      ASSERT_EQ(result.positions[from], mesh.positions[from]);
      ASSERT_EQ(result.positions[to], mesh.positions[to]);
    }
  }
}

TEST_P(Smooth, GivesTheSameBytesOnAnyNumberOfThreads) {
  const Mesh mesh = open_noise();
  test::expect_same_on_any_threads([&] { return smoothed(mesh, GetParam()); }, test::kSameBytes);
}

INSTANTIATE_TEST_SUITE_P(Passes, Smooth,
                         testing::Values(SmoothOptions{means(1, {1})}, SmoothOptions{means(2, {1})},
                                         SmoothOptions{means(5, {1})},
                                         SmoothOptions{means(1, {0.3})},
                                         SmoothOptions{means(4, {0.5})},
                                         SmoothOptions{means(20, {0.9})},
                                         SmoothOptions{means(1, {0.33, -0.34})},
                                         SmoothOptions{means(11, {0.6, -0.64})}));

TEST(SmoothNothing, WithNoPassesLeavesTheBytes) {
  for (const auto& [name, mesh] : meshes()) {
    SCOPED_TRACE(name);
    EXPECT_TRUE(test::same_bytes(smoothed(mesh, {}), mesh));
  }
}

TEST(SmoothNothing, LeavesAnEmptyMeshEmpty) {
  EXPECT_EQ(smoothed(Mesh{}, {means(5, {1})}).positions.size(), 0U);
}

TEST(SmoothNothing, MovesNoVertexOfAMeshThatIsAllBoundary) {
  // The five-way split has no edge inside a cell.
  const Mesh mesh =
      test::extracted(test::checkerboard<std::uint8_t>(0, 9, {2, 2, 2}), {5, Scheme::kFive});
  ASSERT_EQ(mesh.positions.size(), 12U);
  EXPECT_TRUE(test::same_bytes(smoothed(mesh, {means(3, {1})}), mesh));
}

// The expected positions are written out by hand: a pyramid over a square whose border is fixed.
TEST(SmoothByHand, MovesTheOneFreeVertexByItsShare) {
  Mesh mesh;
  mesh.positions.resize_for_overwrite(5);
  const std::vector<Vec3> corners = {{0, 0, 0}, {4, 0, 0}, {4, 4, 0}, {0, 4, 0}, {1, 1, 8}};
  std::copy(corners.begin(), corners.end(), mesh.positions.begin());
  const std::vector<Triangle> sides = {{0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}};
  mesh.triangles.resize_for_overwrite(sides.size());
  std::copy(sides.begin(), sides.end(), mesh.triangles.begin());
  mesh.layer_vertices = {0, 5};
  mesh.layer_triangles = {0, 4};

  const Mesh whole = smoothed(mesh, {means(1, {1})});
  EXPECT_EQ(whole.positions[4], (Vec3{2, 2, 0}));
  const Mesh half = smoothed(mesh, {means(1, {0.5})});
  EXPECT_EQ(half.positions[4], (Vec3{1.5F, 1.5F, 4}));
  const Mesh twice = smoothed(mesh, {means(2, {0.5})});
  EXPECT_EQ(twice.positions[4], (Vec3{1.75F, 1.75F, 2}));
  for (std::size_t v = 0; v < 4; ++v) EXPECT_EQ(twice.positions[v], corners[v]);
}

TEST(SmoothShape, ShrinksABallAndItsSurface) {
  const Mesh mesh = closed_ball();
  const auto before = test::extent_of(test::surface_of(mesh));
  const auto after = test::extent_of(test::surface_of(smoothed(mesh, {means(10, {1})})));
  EXPECT_LT(after.area, before.area);
  EXPECT_LT(after.volume, before.volume);
  EXPECT_GT(after.volume, 0.8 * before.volume);
}

// A volume so deep that slabs are, so that all steps go through it at once.
Mesh deep_noise() {
  return test::extracted(test::noise<std::uint8_t>({0, 1}, {6, 5, 320}, 33),
                         {1, Scheme::kSix, Interpolation::kMidpoint});
}

TEST(SmoothDeepVolume, IsTheSameInOneRoundAndInSeveral) {
  const Mesh mesh = deep_noise();
  const SmoothOptions options = {means(14, {0.7})};
  const Mesh single =
      test::expect_same_on_any_threads([&] { return smoothed(mesh, options); }, test::kSameBytes);
  EXPECT_LT(largest_error(mesh, single, options), 5e-4);
}

// Twenty triangles around one vertex, their outer edges on the boundary.
TEST(SmoothByHand, AVertexMayHaveManyNeighbours) {
  constexpr std::uint32_t kSides = 20;
  Mesh mesh;
  mesh.positions.resize_for_overwrite(kSides + 1);
  mesh.triangles.resize_for_overwrite(kSides);
  double sum = 0;
  for (std::uint32_t side = 0; side < kSides; ++side) {
    const auto x = static_cast<float>(side * side);
    mesh.positions[side] = {x, static_cast<float>(side), 2};
    sum += x;
    mesh.triangles[side] = {side, (side + 1) % kSides, kSides};
  }
  mesh.positions[kSides] = {0, 0, 0};
  mesh.layer_vertices = {0, 13, kSides + 1};
  mesh.layer_triangles = {0, kSides, kSides};
  const Mesh moved = smoothed(mesh, {means(1, {1})});
  EXPECT_FLOAT_EQ(moved.positions[kSides][0], static_cast<float>(sum / kSides));
  EXPECT_FLOAT_EQ(moved.positions[kSides][1], (kSides - 1) / 2.0F);
  EXPECT_FLOAT_EQ(moved.positions[kSides][2], 2);
  EXPECT_EQ(moved.positions[3], mesh.positions[3]);
}

// A corner that is put back comes to lie in line with two that are not: seeds where it did.
TEST(SmoothShape, KeepsTheAreaBesideWhatWouldShrinkToAPoint) {
  struct Case {
    Scheme scheme;
    int passes;
    unsigned seed;
  };
  for (const auto& [scheme, passes, seed] :
       {Case{Scheme::kSix, 1, 1}, Case{Scheme::kBcc, 5, 3}, Case{Scheme::kBcc, 5, 6}}) {
    const auto volume = test::noise<std::uint8_t>({0, 60}, {60, 30, 30}, seed);
    const Mesh mesh = test::extracted(volume, {60, scheme, Interpolation::kLinear});
    EXPECT_TRUE(test::is_sound(test::surface_of(smoothed(mesh, {means(passes, {1})})))) << seed;
  }
}

// A linear function stays linear: a plane's vertices move within the plane.
TEST(SmoothShape, APlaneStaysAPlane) {
  const test::Point normal = {2.0 / 7, 3.0 / 7, 6.0 / 7};
  const Mesh mesh = test::extracted(test::sample<float>(test::plane(normal, 9), {20, 18, 16}), {});
  for (const SmoothOptions& options :
       {SmoothOptions{means(10, {1})}, SmoothOptions{means(10, {0.33, -0.34})}}) {
    const Mesh moved = smoothed(mesh, options);
    double farthest = 0;
    for (const Vec3& p : moved.positions) {
      const double at = normal[0] * p[0] + normal[1] * p[1] + normal[2] * p[2];
      farthest = std::max(farthest, std::abs(at - 9));
    }
    EXPECT_LT(farthest, 1e-5);
    EXPECT_FALSE(test::same_bytes(moved, mesh));
  }
}

TEST(SmoothTaubin, FindsTheSecondStepFromThePassBand) {
  EXPECT_NEAR(taubin_mu(0.6307, 0.1), -0.67315, 1e-5);  // the example of Taubin's paper
  EXPECT_NEAR(1 / taubin_mu(0.33, 0.05) + 1 / 0.33, 0.05, 1e-12);
}

TEST(SmoothTaubin, KeepsTheVolumeThatLaplacianPassesTakeAway) {
  const Mesh mesh = closed_ball();
  const double before = test::extent_of(test::surface_of(mesh)).volume;
  const auto drift = [&](const SmoothOptions& options) {
    return std::abs(test::extent_of(test::surface_of(smoothed(mesh, options))).volume / before - 1);
  };
  EXPECT_GT(drift({means(20, {1})}), 0.05);
  EXPECT_LT(drift({means(20, {0.33, taubin_mu(0.33, 0.1)})}), 0.002);
}

TEST(SmoothTaubin, KeepsTheVolumeOfTheBrainToATenthOfAPercent) {
  Mesh mesh = test::extracted(test::read_nifti_samples(test::kBrainFile),
                              {60, Scheme::kSix, Interpolation::kLinear});
  const SmoothingEffect effect = smooth(test::method_options(Smoothing::kTaubin, 20), {}, mesh);
  EXPECT_NEAR(effect.after.volume_mm3 / effect.before.volume_mm3, 1, 0.001);
  EXPECT_LT(effect.after.area_mm2, 0.95 * effect.before.area_mm2);
}

void expect_same(const Extent& a, const Extent& b) {
  EXPECT_EQ(a.area_mm2, b.area_mm2);
  EXPECT_EQ(a.volume_mm3, b.volume_mm3);
  EXPECT_EQ(a.low, b.low);
  EXPECT_EQ(a.high, b.high);
}

class SmoothEffect : public testing::TestWithParam<int> {};

TEST_P(SmoothEffect, IsWhatMeasuringTheMeshesBeforeAndAfterSays) {
  const test::ThreadCount threads(GetParam());
  for (const SmoothOptions& options :
       {SmoothOptions{}, SmoothOptions{means(3, {1})}, SmoothOptions{means(9, {0.33, -0.34})}}) {
    for (const auto& [name, before] : meshes()) {
      SCOPED_TRACE(name);
      Mesh after = copy_of(before);
      const SmoothingEffect effect = smooth(options, {}, after);
      expect_same(effect.before, measure_extent(before, {}));
      expect_same(effect.after, measure_extent(after, {}));
      double sum = 0;
      double largest = 0;
      for (std::size_t v = 0; v < before.positions.size(); ++v) {
        const double way = test::distance(before.positions[v], after.positions[v]);
        sum += way;
        largest = std::max(largest, way);
      }
      EXPECT_NEAR(effect.mean_displacement_mm, sum / static_cast<double>(before.positions.size()),
                  1e-9);
      EXPECT_NEAR(effect.max_displacement_mm, largest, 1e-9);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Threads, SmoothEffect, testing::Values(1, 2, 16));

class SmoothWithin : public testing::TestWithParam<double> {};

TEST_P(SmoothWithin, MovesNoVertexFarther) {
  const double limit = GetParam();
  for (const SmoothOptions& unlimited :
       {SmoothOptions{means(5, {1})}, SmoothOptions{means(14, {0.6, -0.64})}}) {
    for (const auto& [name, before] : meshes()) {
      SCOPED_TRACE(name);
      SmoothOptions options = unlimited;
      options.max_displacement_mm = limit;
      const Mesh after = smoothed(before, options);
      double largest = 0;
      for (std::size_t v = 0; v < before.positions.size(); ++v) {
        largest = std::max(largest, test::distance(before.positions[v], after.positions[v]));
      }
      EXPECT_LE(largest, limit * (1 + 1e-12));
      Mesh copy = copy_of(before);
      const double free_largest = smooth(unlimited, {}, copy).max_displacement_mm;
      if (free_largest > limit) {
        EXPECT_GE(largest, 0.99 * limit);
      }
      const test::ThreadCount several(16);
      EXPECT_TRUE(test::same_bytes(smoothed(before, options), after));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Limits, SmoothWithin, testing::Values(0.0, 1e-3, 0.05, 0.5));

TEST(SmoothWithin, AFarLimitChangesNothing) {
  const Mesh mesh = open_noise();
  SmoothOptions options = {means(5, {1})};
  const Mesh free = smoothed(mesh, options);
  options.max_displacement_mm = 100;
  EXPECT_TRUE(test::same_bytes(smoothed(mesh, options), free));
}

// Taubin's second step would push what is next to a cap through it.
TEST(SmoothWithin, KeepsClosedSurfacesOnTheirSideOfTheCaps) {
  for (const Geometry& geometry : {Geometry{}, test::oblique_geometry()}) {
    const auto volume = test::sample<float>(test::gyroid(8.3), {31, 30, 29}, geometry);
    const ExtractOptions closed = {0, Scheme::kSix, Interpolation::kLinear, true};
    const auto farthest_out = [&](const std::vector<HalfSpace>& within) {
      Mesh mesh = test::extracted(volume, closed);
      smooth({.steps = means(20, {0.33, taubin_mu(0.33, 0.1)}), .within = within}, {}, mesh);
      double farthest = -std::numeric_limits<double>::infinity();
      for (const HalfSpace& half : box_around(volume.lattice().to_space, volume.dims, 0)) {
        for (const Vec3& p : mesh.positions) {
          farthest = std::max(farthest, half.normal[0] * p[0] + half.normal[1] * p[1] +
                                            half.normal[2] * p[2] - half.offset);
        }
      }
      return farthest;
    };
    constexpr double kRounding = 1e-4;
    EXPECT_GT(farthest_out({}), 100 * kRounding);
    EXPECT_LT(farthest_out(box_around(volume.lattice().to_space, volume.dims, 0)), kRounding);
  }
}

TEST(SmoothWithin, KeepsMovesAlongTheSurfaceOnTheirSideOfTheCaps) {
  const ExtractOptions closed = {2, Scheme::kSix, Interpolation::kLinear, true};
  for (const Smoothing smoothing : {Smoothing::kAngle, Smoothing::kOptimize}) {
    double farthest_out = 0;
    for (std::uint64_t seed = 0; seed < 20; ++seed) {
      const auto volume = test::noise<std::uint8_t>({0, 1, 2, 3, 4}, {7, 9, 8}, seed);
      SmoothOptions options = test::method_options(smoothing, 5);
      EXPECT_TRUE(options.goes_outwards());
      options.within = box_around(volume.lattice().to_space, volume.dims, 0);
      for (const Vec3& p : smoothed(test::extracted(volume, closed), options).positions) {
        for (const HalfSpace& half : options.within) {
          farthest_out = std::max(farthest_out, half.normal[0] * p[0] + half.normal[1] * p[1] +
                                                    half.normal[2] * p[2] - half.offset);
        }
      }
    }
    EXPECT_LT(farthest_out, 1e-6);
  }
}

TEST(SmoothMemory, IsAFewLayersWhenTheVolumeIsDeep) {
  const test::ThreadCount two(2);
  const auto size = [](std::uint64_t layers, std::uint64_t vertices_each) {
    return test::even_surface(layers, vertices_each, 2 * vertices_each);
  };
  const SurfaceSize deep = size(1024, 1000);
  const std::uint64_t five = smoothing_memory({means(5, {1})}, deep);
  EXPECT_EQ(five, smoothing_memory({means(5, {1})}, size(512, 1000)));
  EXPECT_LT(five, 2000 * deep.largest_layer());
  // Twenty at once, rather than a copy of everything.
  EXPECT_LT(smoothing_memory({means(20, {1})}, deep), deep.vertices * sizeof(Vec3));
  // On a shallow one never much more than that copy.
  const SurfaceSize shallow = size(100, 1000);
  EXPECT_LT(smoothing_memory({means(500, {1})}, shallow),
            shallow.vertices * sizeof(Vec3) + 2'500'000);
  EXPECT_EQ(smoothing_memory({}, deep), 0U);
  EXPECT_EQ(smoothing_memory({means(5, {1})}, {}), 0U);
}

TEST(SmoothCancellation, BeforeTheStartEndsIt) {
  Mesh mesh = open_noise();
  std::stop_source source;
  source.request_stop();
  const Context stopped{source.get_token(), {}};
  EXPECT_EQ(test::code_thrown_by([&] { smooth({means(5, {1})}, stopped, mesh); }),
            ErrorCode::kCancelled);
  EXPECT_EQ(test::code_thrown_by([&] { smooth({}, stopped, mesh); }), ErrorCode::kCancelled);
}

TEST(SmoothCancellation, OnTheWayEndsIt) {
  Mesh mesh = open_noise();
  std::stop_source source;
  int reports = 0;
  const test::ThreadCount one(1);
  const Context stops_itself{source.get_token(), [&](double) {
                               ++reports;
                               source.request_stop();
                             }};
  EXPECT_EQ(test::code_thrown_by([&] { smooth({means(1000, {1})}, stops_itself, mesh); }),
            ErrorCode::kCancelled);
  EXPECT_EQ(reports, 1);
}

TEST(SmoothProgress, RisesToOne) {
  Mesh mesh = open_noise();
  const test::ThreadCount one(1);
  std::vector<double> reports;
  const Context context{{}, [&](double share) { reports.push_back(share); }};
  smooth({means(20, {1})}, context, mesh);
  ASSERT_GE(reports.size(), mesh.layers());
  EXPECT_GE(reports.front(), 0);
  EXPECT_TRUE(std::is_sorted(reports.begin(), reports.end()));
  EXPECT_DOUBLE_EQ(reports.back(), 1);
}

}  // namespace
}  // namespace isomesh::mesh
