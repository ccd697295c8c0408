#include "server/mesh/collapse/simplify.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/labels/separate.h"
#include "server/mesh/measure/distance.h"
#include "server/mesh/measure/measure.h"
#include "server/mesh/measure/self_intersections.h"
#include "server/mesh/smooth/smooth.h"
#include "server/mesh/topology/topology.h"
#include "tests/support/any_threads.h"
#include "tests/support/errors.h"
#include "tests/support/kernels.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/points.h"
#include "tests/support/shapes.h"
#include "tests/support/step.h"

namespace isomesh::mesh {
namespace {

// Handles in all directions over several blocks: some 60 000 triangles.
Mesh handles(bool close) {
  Mesh mesh = test::extracted(test::sample<float>(test::gyroid(17), {30, 29, 33}),
                              {0, Scheme::kSix, Interpolation::kLinear, close});
  smooth({.steps = test::means(3, {1})}, {}, mesh);
  return mesh;
}

// With noise on them, so that walls are thin and have holes, as bone in a scan has.
Mesh noisy_handles() {
  auto volume = test::sample<float>(test::gyroid(17), {40, 39, 43});
  const auto noise = test::noise_between<float>(-0.4, 0.4, volume.dims, 11);
  for (std::size_t n = 0; n < volume.samples.size(); ++n) volume.samples[n] += noise.samples[n];
  Mesh mesh = test::extracted(volume, {0, Scheme::kSix, Interpolation::kLinear, true});
  smooth({.steps = test::means(3, {1})}, {}, mesh);
  return mesh;
}

// A ball that the volume's border cuts in half.
Mesh half_ball(bool close) {
  return test::extracted(test::sample<float>(test::sphere({20, 20, 0}, 17.3), {41, 41, 30}),
                         {0, Scheme::kSix, Interpolation::kLinear, close});
}

// Noise: specks and thin sheets, which no neighbourhood of is flat.
Mesh noise() {
  Mesh mesh = test::extracted(test::noise<std::uint8_t>({0, 1, 2, 3}, {26, 25, 24}, 7),
                              {1.5, Scheme::kSix, Interpolation::kLinear, true});
  smooth({.steps = test::means(2, {1})}, {}, mesh);
  return mesh;
}

std::array<std::uint64_t, 2> sizes(const Mesh& mesh) {
  return {mesh.positions.size(), mesh.triangles.size()};
}

// The surface within the error of what it was, and of the same kind.
void expect_simplified(const Mesh& mesh, const Mesh& original, double max_error_mm) {
  const Certificate certificate = certify(mesh, original, {});
  EXPECT_LE(certificate.max_mm(), max_error_mm);
  const Topology before = measure_topology(original, {});
  const Topology after = measure_topology(mesh, {});
  EXPECT_EQ(after, before);
  EXPECT_TRUE(after.manifold && after.oriented);
  EXPECT_TRUE(test::is_sound(test::surface_of(mesh)));
  test::expect_layers(mesh);
}

TEST(Simplify, KeepsWithinTheErrorBothWaysAndTheSurfaceOfItsKind) {
  for (const bool close : {false, true}) {
    std::uint64_t last = ~std::uint64_t{0};
    for (const double error : {0.01, 0.05, 0.2}) {
      Mesh mesh = handles(close);
      const SimplificationEffect effect = simplify({.max_error_mm = error}, {}, mesh);
      expect_simplified(mesh, handles(close), error);
      EXPECT_EQ(effect.triangles_after, mesh.triangles.size());
      EXPECT_EQ(effect.triangles_before, handles(close).triangles.size());
      EXPECT_LT(effect.triangles_after, last);
      last = effect.triangles_after;
    }
    EXPECT_LT(last, handles(close).triangles.size() / 4);
  }
}

TEST(Simplify, KeepsNoiseOfItsKind) {
  for (const double error : {0.05, 0.3, 1.0}) {
    const Mesh original = noise();
    Mesh mesh = noise();
    simplify({.max_error_mm = error}, {}, mesh);
    EXPECT_LT(mesh.triangles.size(), original.triangles.size());
    EXPECT_LE(certify(mesh, original, {}).max_mm(), error);
    EXPECT_EQ(measure_topology(mesh, {}), measure_topology(original, {}));
    test::expect_layers(mesh);
  }
}

// A lost part and a cut handle together leave the sums over the surface as they were.
TEST(Simplify, KeepsEveryPartOfNoise) {
  for (const Scheme scheme : {Scheme::kFive, Scheme::kSix, Scheme::kBcc}) {
    for (const unsigned seed : {13U, 16U, 21U, 24U, 29U}) {  // each with such a case in a scheme
      SCOPED_TRACE(seed);
      const Mesh original =
          test::extracted(test::noise_between<std::uint8_t>(0, 255, {14, 13, 12}, seed),
                          {100.5, scheme, Interpolation::kLinear, true});
      Mesh mesh = test::copy_of(original);
      simplify({.max_error_mm = seed % 2 == 0 ? 1.5 : 3}, {}, mesh);
      EXPECT_EQ(measure_topology(mesh, {}), measure_topology(original, {}));
    }
  }
}

// Most proposals exceed the error somewhere. The places where they do not are still simplified.
TEST(Simplify, LeavesFewerTrianglesOfNoiseTheMoreErrorItMayMake) {
  std::uint64_t last = ~std::uint64_t{0};
  for (const double error : {0.1, 0.2, 0.5}) {
    Mesh mesh = noisy_handles();
    simplify({.max_error_mm = error}, {}, mesh);
    EXPECT_LT(mesh.triangles.size(), last) << error;
    last = mesh.triangles.size();
  }
}

TEST(Simplify, KeepsAllOfABoundary) {
  const Mesh original = half_ball(false);
  Mesh mesh = half_ball(false);
  simplify({.max_error_mm = 0.3}, {}, mesh);
  expect_simplified(mesh, original, 0.3);
  const auto edges = [](const Mesh& of) {
    std::vector<std::array<Vec3, 2>> places;
    for (const auto& [a, b] : test::topology_of(test::surface_of(of)).boundary_edges) {
      places.push_back({of.positions[a], of.positions[b]});
    }
    std::ranges::sort(places);
    return places;
  };
  EXPECT_EQ(edges(mesh), edges(original));
  EXPECT_LT(mesh.triangles.size(), original.triangles.size() / 3);
}

TEST(Simplify, KeepsCapsInTheirPlane) {
  constexpr double kError = 0.05;
  const Mesh original = half_ball(true);
  Mesh mesh = half_ball(true);
  simplify({.max_error_mm = kError}, {}, mesh);
  expect_simplified(mesh, original, kError);
  std::size_t marked = 0;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    EXPECT_GE(mesh.positions[v][2], 0);
    EXPECT_EQ(mesh.is_on_border(v), mesh.positions[v][2] == 0) << v;
    marked += mesh.is_on_border(v) ? 1 : 0;
  }
  EXPECT_GT(marked, 10U);
}

TEST(Simplify, ReachesANumberOfTriangles) {
  for (const std::uint64_t triangles : {20'000, 6'000}) {
    Mesh mesh = handles(true);
    const SimplificationEffect effect = simplify({.triangles = triangles}, {}, mesh);
    EXPECT_LE(mesh.triangles.size(), triangles);
    EXPECT_GT(mesh.triangles.size(), triangles / 2);
    EXPECT_TRUE(effect.reached_triangles);
    EXPECT_EQ(measure_topology(mesh, {}), measure_topology(handles(true), {}));
  }
}

// Two of three and of four samples a side.
Mesh two_cubes() {
  auto samples = test::constant<std::uint8_t>(0, {10, 14, 17});
  for (std::uint32_t k = 0; k < 9; ++k) {
    for (std::uint32_t j = 0; j < 9; ++j) {
      for (std::uint32_t i = 0; i < 9; ++i) {
        const auto [low, high] = std::minmax({i, j, k});
        if ((low >= 1 && high < 4) || low >= 5) samples.at(i, j, k) = 1;
      }
    }
  }
  return test::extracted(samples, {0.5, Scheme::kSix, Interpolation::kLinear, true});
}

// As sets of vertices, each is there once: none lie back to back.
void expect_no_doubles(const Mesh& mesh) {
  std::vector<Triangle> triangles(mesh.triangles.begin(), mesh.triangles.end());
  for (Triangle& triangle : triangles) std::ranges::sort(triangle);
  std::ranges::sort(triangles);
  EXPECT_TRUE(std::ranges::adjacent_find(triangles) == triangles.end());
}

TEST(Simplify, ReachesEveryNumberThatTheSurfaceCanHave) {
  constexpr std::uint64_t kLeast = 8;  // two tetrahedra
  const Topology before = measure_topology(two_cubes(), {});
  for (std::uint64_t triangles = 1; triangles <= 100; ++triangles) {
    SCOPED_TRACE(triangles);
    Mesh mesh = two_cubes();
    const SimplificationEffect effect = simplify({.triangles = triangles}, {}, mesh);
    EXPECT_EQ(mesh.triangles.size(), effect.triangles_after);
    EXPECT_LE(mesh.triangles.size(), std::max(triangles, kLeast));
    EXPECT_EQ(effect.reached_triangles, triangles >= kLeast);
    EXPECT_EQ(effect.is_least, triangles < kLeast);
    EXPECT_EQ(measure_topology(mesh, {}), before);
    EXPECT_TRUE(test::is_sound(test::surface_of(mesh)));
    EXPECT_GT(measure_extent(mesh, {}).volume_mm3, 0);
    expect_no_doubles(mesh);
    test::expect_layers(mesh);
  }
}

TEST(Simplify, GoesOnUntilTheSurfaceNeedsAllThatIsLeft) {
  const Topology before = measure_topology(half_ball(false), {});
  Mesh open = half_ball(false);
  EXPECT_TRUE(simplify({.triangles = 4}, {}, open).is_least);
  EXPECT_EQ(measure_topology(open, {}), before);
  EXPECT_LE(open.triangles.size(), before.boundary_edges);  // which all stay
  Mesh holes = handles(true);
  EXPECT_TRUE(simplify({.triangles = 4}, {}, holes).is_least);
  EXPECT_EQ(measure_topology(holes, {}), measure_topology(handles(true), {}));
  EXPECT_LT(holes.triangles.size(), 400U);
  expect_no_doubles(holes);
  Mesh near = half_ball(false);
  EXPECT_FALSE(simplify({.max_error_mm = 0.01, .triangles = 4}, {}, near).is_least);
}

TEST(Simplify, ToANumberMakesNoTrianglesIntersect) {
  for (const bool is_noisy : {false, true}) {
    const Mesh original = is_noisy ? noisy_handles() : handles(true);
    ASSERT_EQ(find_self_intersections(original, {}).pairs, 0U);
    const std::array<std::uint64_t, 3> shares = {3, 10, 40};
    for (std::size_t n = 0; n < shares.size(); n += test::kStep) {
      const std::uint64_t share = shares[n];
      Mesh mesh = test::copy_of(original);
      const std::uint64_t target = mesh.triangles.size() / share;
      const SimplificationEffect effect = simplify({.triangles = target}, {}, mesh);
      EXPECT_EQ(find_self_intersections(mesh, {}).pairs, 0U) << is_noisy << ' ' << share;
      EXPECT_TRUE(effect.reached_triangles);
      EXPECT_LE(mesh.triangles.size(), target);
    }
  }
}

TEST(Simplify, SaysWhichOfErrorAndTrianglesHasBound) {
  Mesh few = handles(true);
  const SimplificationEffect error_binds =
      simplify({.max_error_mm = 0.01, .triangles = 100}, {}, few);
  EXPECT_FALSE(error_binds.reached_triangles);
  EXPECT_LE(certify(few, handles(true), {}).max_mm(), 0.01);
  Mesh many = handles(true);
  const std::uint64_t goal = many.triangles.size() * 9 / 10;
  const SimplificationEffect triangles_bind =
      simplify({.max_error_mm = 1, .triangles = goal}, {}, many);
  EXPECT_TRUE(triangles_bind.reached_triangles);
  EXPECT_GT(many.triangles.size(), goal * 8 / 10);
  EXPECT_LE(certify(many, handles(true), {}).max_mm(), 1);
}

TEST(Simplify, LeavesAMeshThatHasFewEnough) {
  const Mesh original = half_ball(true);
  Mesh mesh = half_ball(true);
  const SimplificationEffect effect =
      simplify({.max_error_mm = 0.2, .triangles = original.triangles.size()}, {}, mesh);
  EXPECT_EQ(sizes(mesh), sizes(original));
  EXPECT_EQ(effect.triangles_after, effect.triangles_before);
}

// Flat but for its border: all within goes, whatever the error.
TEST(Simplify, LeavesLittleOfAPlane) {
  const auto plane = [] {
    return test::extracted(test::sample<float>(test::plane({0, 0.6, 0.8}, 14.2), {40, 40, 40}),
                           {0, Scheme::kSix, Interpolation::kLinear, false});
  };
  Mesh mesh = plane();
  simplify({.max_error_mm = 0.05}, {}, mesh);
  expect_simplified(mesh, plane(), 0.05);
  EXPECT_LT(mesh.triangles.size(), plane().triangles.size() / 5);
}

TEST(Simplify, IsTheSameOnAnyNumberOfThreads) {
  const auto make = [] {
    Mesh mesh = handles(true);
    simplify({.max_error_mm = 0.1}, {}, mesh);
    return mesh;
  };
  test::expect_same_on_any_threads(make, test::kSameBytes);
}

// Four labels that meet in lines and in a point.
TEST(Simplify, KeepsLinesWhereWallsMeet) {
  test::SampleVolume<std::uint8_t> labels = test::constant<std::uint8_t>(0, {30, 30, 30});
  for (std::uint64_t z = 3; z < 27; ++z) {
    for (std::uint64_t y = 3; y < 27; ++y) {
      for (std::uint64_t x = 3; x < 27; ++x) {
        labels.at(x, y, z) = static_cast<std::uint8_t>(x < 14 ? 1 : y < 16 ? 2 : z < 13 ? 3 : 4);
      }
    }
  }
  const auto walls = [&] {
    SeparateOptions options;
    options.labels = {1, 2, 3, 4};
    SeparatingSurface surface;
    extract_walls(labels.lattice(), options, count_walls(labels.lattice(), options, {}), {},
                  surface);
    return surface;
  };
  const SeparatingSurface original = walls();
  SeparatingSurface surface = walls();
  simplify({.max_error_mm = 0.1}, {}, surface.mesh);
  EXPECT_LT(surface.mesh.triangles.size(), original.mesh.triangles.size() / 2);
  EXPECT_LE(certify(surface.mesh, original.mesh, {}).max_mm(), 0.1);
  const auto on_lines = [](const Mesh& mesh) {
    std::vector<Vec3> places;
    for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
      if (mesh.is_on_line(v)) places.push_back(mesh.positions[v]);
    }
    return places;
  };
  EXPECT_EQ(on_lines(surface.mesh), on_lines(original.mesh));
  EXPECT_FALSE(on_lines(original.mesh).empty());
  EXPECT_EQ(measure_topology(surface.mesh, {}).boundary_edges, 0U);
}

// From where the vertices were before they were smoothed.
TEST(Simplify, KeepsWithinTheErrorOfWhereTheVerticesWere) {
  constexpr double kError = 0.3;
  const auto ball = test::sample<float>(test::sphere({20, 20, 20}, 17.3), {41, 41, 41});
  const ExtractOptions options = {0, Scheme::kSix, Interpolation::kMidpoint, false};
  const Mesh extracted = test::extracted(ball, options);
  Mesh mesh = test::extracted(ball, options);
  smooth({.steps = test::means(5, {1}), .max_displacement_mm = kError / 2}, {}, mesh);
  simplify({.max_error_mm = kError, .before = extracted.positions.span()}, {}, mesh);
  EXPECT_LT(mesh.triangles.size(), extracted.triangles.size() / 2);
  const double from_extracted = certify(mesh, extracted, {}).max_mm();
  EXPECT_LE(from_extracted, kError);
  EXPECT_GT(from_extracted, kError / 2);  // more than smoothing may take
  EXPECT_EQ(measure_topology(mesh, {}), measure_topology(extracted, {}));
}

// Smoothing may shrink a speck to a point.
TEST(Simplify, KeepsTrianglesWithoutAreaWhereTheyAre) {
  std::vector<Vec3> positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  positions.insert(positions.end(), 4, {5, 5, 5});
  const std::vector<Triangle> triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3},
                                           {4, 6, 5}, {4, 5, 7}, {4, 7, 6}, {5, 6, 7}};
  Mesh mesh = test::mesh_of(positions, triangles);
  simplify({.max_error_mm = 10}, {}, mesh);
  EXPECT_EQ(measure_topology(mesh, {}), measure_topology(test::mesh_of(positions, triangles), {}));
}

TEST(Simplify, OfNothingIsNothing) {
  Mesh mesh = test::mesh_of({}, {});
  const SimplificationEffect effect = simplify({.max_error_mm = 1}, {}, mesh);
  EXPECT_EQ(effect.triangles_before, 0U);
  EXPECT_TRUE(effect.reached_triangles);
}

TEST(Simplify, RefusesWhatIsNotANumber) {
  Mesh mesh = half_ball(true);
  mesh.positions[mesh.triangles[7][1]][1] = std::nanf("");
  for (const SimplifyOptions& options :
       {SimplifyOptions{.max_error_mm = 1}, SimplifyOptions{.triangles = 100}}) {
    EXPECT_EQ(test::code_thrown_by([&] { simplify(options, {}, mesh); }),
              ErrorCode::kUnusableVolume);
  }
}

TEST(Simplify, StopsWhenItIsCancelledAndLeavesTheMesh) {
  std::stop_source stop;
  const Mesh original = handles(true);
  Mesh mesh = handles(true);
  // In the middle of the first round.
  const Context context = {stop.get_token(), [&](double) { stop.request_stop(); }};
  EXPECT_EQ(test::code_thrown_by([&] { simplify({.max_error_mm = 0.1}, context, mesh); }),
            ErrorCode::kCancelled);
  EXPECT_TRUE(test::same_bytes(mesh, original));
}

}  // namespace
}  // namespace isomesh::mesh
