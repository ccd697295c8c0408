#include "server/mesh/collapse/bound.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/measure/measure.h"
#include "server/mesh/measure/self_intersections.h"
#include "server/mesh/smooth/smooth.h"
#include "server/mesh/topology/components.h"
#include "server/mesh/topology/topology.h"
#include "tests/support/any_threads.h"
#include "tests/support/exact_distance.h"
#include "tests/support/kernels.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/shapes.h"
#include "tests/support/step.h"

namespace isomesh::mesh {
namespace {

test::TriangleSoup soup_of(const Mesh& mesh) {
  test::TriangleSoup soup;
  for (const Triangle& triangle : mesh.triangles) {
    std::array<std::array<double, 3>, 3> corners;
    for (std::size_t i = 0; i < 3; ++i) {
      const Vec3& p = mesh.positions[triangle[i]];
      corners[i] = {p[0], p[1], p[2]};
    }
    soup.triangles.push_back(corners);
  }
  return soup;
}

template <class T>
std::optional<BoundedMesh> simplified(const test::SampleVolume<T>& volume,
                                      const ExtractOptions& extract, const BoundOptions& options,
                                      Mesh& mesh) {
  return simplify_within(volume.lattice(), extract, options, {}, mesh);
}

// Exact distances of random points, both ways, by independent code. `plain`: the whole surface or
// some components of it.
template <class T>
void expect_within_of(const test::SampleVolume<T>& volume, const ExtractOptions& extract,
                      double error_mm, const Mesh& plain) {
  Mesh mesh = test::copy_of(plain);
  const auto bound = simplified(volume, extract, {.max_error_mm = error_mm}, mesh);
  ASSERT_TRUE(bound);
  EXPECT_LE(bound->bound_mm, error_mm);
  EXPECT_EQ(bound->triangles_before, plain.triangles.size());
  EXPECT_EQ(bound->bound_at(mesh.positions.span()), bound->bound_mm);
  const test::TriangleSoup before = soup_of(plain);
  const test::TriangleSoup after = soup_of(mesh);
  constexpr double kSinglePrecision = 1e-4;  // of the plain surface's own coordinates
  EXPECT_LE(test::largest_distance(after, before, 1000, 1), bound->bound_mm + kSinglePrecision);
  EXPECT_LE(test::largest_distance(before, after, 1000, 2), bound->bound_mm + kSinglePrecision);
  const Topology was = measure_topology(plain, {});
  const Topology is = measure_topology(mesh, {});
  EXPECT_EQ(is.manifold, was.manifold);
  EXPECT_EQ(is.oriented, was.oriented);
  EXPECT_EQ(is.boundary_edges, was.boundary_edges);
  EXPECT_TRUE(test::is_sound(test::surface_of(mesh)));
  EXPECT_EQ(find_self_intersections(mesh, {}).pairs, 0U);
}

template <class T>
void expect_within_by_scheme(const test::SampleVolume<T>& volume, const ExtractOptions& extract,
                             double error_mm) {
  expect_within_of(volume, extract, error_mm, test::extracted(volume, extract));
}

template <class T>
void expect_within(const test::SampleVolume<T>& volume, ExtractOptions extract, double error_mm) {
  for (const Scheme scheme : test::kSchemes) {
    SCOPED_TRACE(static_cast<int>(scheme));
    extract.scheme = scheme;
    expect_within_by_scheme(volume, extract, error_mm);
  }
}

TEST(BoundTest, KeepsAllOfASphereWithinTheError) {
  const auto volume = test::sample<float>(test::sphere({5.2, 5.1, 4.9}, 3.9), {11, 11, 11});
  for (const double error : {0.02, 0.1, 0.5, 2.0}) expect_within(volume, {}, error);
}

TEST(BoundTest, KeepsAllOfASurfaceThatEndsAtTheBorderWithinTheError) {
  const auto volume = test::sample<float>(test::gyroid(7), {10, 9, 8});
  for (const double error : {0.05, 0.3}) expect_within(volume, {}, error);
}

TEST(BoundTest, KeepsAllOfAClosedSurfaceWithinTheError) {
  const auto gyroid = test::sample<float>(test::gyroid(7), {10, 9, 8});
  const auto noise = test::noise<std::uint8_t>({0, 1, 2, 3}, {7, 6, 5}, 5);
  const auto full = test::constant<std::int16_t>(100, {6, 5, 4});  // caps alone
  for (const double error : {0.05, 0.3, 1.5}) {
    expect_within(gyroid, {.close = true}, error);
    expect_within(noise, {.iso = 2, .close = true}, error);
    expect_within(noise, {.iso = 1.5, .interpolation = Interpolation::kMidpoint, .close = true},
                  error);
    expect_within(full, {.iso = 50, .close = true}, error);
  }
}

// A component that is hardly larger than a sample, most of whose triangles lie in the cap's plane.
TEST(BoundTest, KeepsASampleAtTheIsoValueInEachFaceOfAClosedVolume) {
  constexpr Dims kDims = {5, 6, 7};
  for (const std::array<std::uint32_t, 3> at :
       {std::array{0U, 2U, 3U}, std::array{4U, 3U, 2U}, std::array{2U, 0U, 3U},
        std::array{2U, 5U, 3U}, std::array{2U, 3U, 0U}, std::array{2U, 3U, 6U},
        std::array{0U, 0U, 3U}, std::array{4U, 5U, 6U}}) {
    auto volume = test::constant<std::uint8_t>(10, kDims);
    volume.at(at[0], at[1], at[2]) = 30;
    expect_within(volume, {.iso = 30, .close = true}, 0.1);
  }
}

TEST(BoundTest, ProvesSmallNoiseWithManySamplesAtTheIsoValue) {
  std::mt19937 random(5);
  const auto one_of = [&](std::uint32_t count) {
    return static_cast<std::uint32_t>(random() % count);
  };
  for (int i = 0; i < 400; ++i) {
    const Dims dims = {2 + one_of(6), 2 + one_of(6), 2 + one_of(6)};
    const auto volume = test::noise<std::uint8_t>({0, 1, 1, 1, 2}, dims, random());
    const ExtractOptions extract = {
        .iso = 2, .scheme = test::kSchemes[one_of(3)], .close = i % 3 != 0};
    Mesh mesh = test::extracted(volume, extract);
    const double error = std::array{0.02, 0.1, 0.5, 2.0}[one_of(4)];
    const auto bound = simplified(volume, extract, {.max_error_mm = error}, mesh);
    ASSERT_TRUE(bound) << i;
    EXPECT_LE(bound->bound_mm, error) << i;
  }
}

// Each vertex of a cap is in the cap's plane, to the bit, and few are left.
TEST(BoundTest, KeepsCapsFlat) {
  const auto volume = test::sample<float>(test::sphere({16, 16, 0}, 13.3), {33, 33, 20});
  Mesh mesh = test::extracted(volume, {.close = true});
  const auto in_cap = [](const Vec3& p) { return p[2] == 0; };
  const auto before = std::ranges::count_if(mesh.positions, in_cap);
  ASSERT_TRUE(simplified(volume, {.close = true}, {.max_error_mm = 0.1}, mesh));
  EXPECT_EQ(std::ranges::min(mesh.positions, {}, [](const Vec3& p) { return p[2]; })[2], 0);
  const auto after = std::ranges::count_if(mesh.positions, in_cap);
  EXPECT_GT(after, 10);
  EXPECT_LT(after, before / 5);
  const double area = measure_extent(mesh, {}).area_mm2;
  EXPECT_NEAR(area, 3 * std::numbers::pi * 13.3 * 13.3, 0.01 * area);
}

TEST(BoundTest, KeepsAllOfNoiseWithinTheError) {
  const auto floats = test::noise_between<float>(-1, 1, {6, 5, 7}, 3);
  const auto equal = test::noise<std::uint8_t>({0, 1, 2, 3}, {7, 6, 5}, 5);
  for (const double error : {0.05, 0.2, 0.7}) {
    expect_within(floats, {.iso = 0.01}, error);
    expect_within(equal, {.iso = 2}, error);  // many samples equal to the iso-value
    expect_within(equal, {.iso = 1.5, .interpolation = Interpolation::kMidpoint}, error);
  }
}

TEST(BoundTest, KeepsAllOfPlateausAndOfTheSmallestVolumeWithinTheError) {
  auto plateau = test::constant<std::int16_t>(100, {9, 9, 9});  // the iso-value, and a hole in it
  for (std::uint64_t i = 3; i < 6; ++i) plateau.at(i, 4, 4) = 90;
  expect_within(plateau, {.iso = 100}, 0.3);
  for (unsigned inside = 1; inside < 255; inside += 7) {
    auto cell = test::constant<float>(-1, {2, 2, 2});
    for (unsigned c = 0; c < 8; ++c) {
      if ((inside >> c & 1) != 0)
        cell.samples[c] = static_cast<float>(c) * 0.3F;  // 0: the iso-value
    }
    expect_within(cell, {}, 0.2);
  }
}

// The mesh without those components whose bit in `left_out` is set.
Mesh without(const Mesh& whole, std::uint64_t left_out) {
  Mesh mesh = test::copy_of(whole);
  Components components;
  find_components(mesh, {}, components);
  std::vector<bool> kept;
  for (std::uint32_t n = 0; n < components.count; ++n)
    kept.push_back((left_out >> n % 64 & 1) == 0);
  leave_out(kept, triangles_of(components, mesh), components, mesh);
  return mesh;
}

TEST(BoundTest, KeepsAnyComponentsOfNoiseWithinTheError) {
  std::mt19937_64 random(3);
  for (unsigned i = 0; i < 24; ++i) {
    const auto volume = test::noise<std::uint8_t>({0, 0, 0, 1, 2}, {6, 5, 7}, i);
    const ExtractOptions extract = {
        .iso = i % 2 == 0 ? 1.5 : 1,
        .scheme = test::kSchemes[i % 3],
        .interpolation = i % 5 == 0 ? Interpolation::kMidpoint : Interpolation::kLinear,
        .close = i % 4 < 2};
    SCOPED_TRACE(i);
    const Mesh whole = test::extracted(volume, extract);
    const Mesh some = without(whole, random());
    expect_within_of(volume, extract, 0.2, some);
    expect_within_of(volume, extract, 0.2, without(some, random()));
  }
}

// Walls within walls, each alone: around solid and around hollow parts.
TEST(BoundTest, KeepsEachOfSeveralNestedShellsWithinTheError) {
  const auto onion = [](const test::Point& p) {
    return std::sin(1.9 * std::hypot(p[0] - 5.2, p[1] - 5.1, p[2] - 4.9));
  };
  const auto geometries = test::all_geometries();
  for (std::size_t g = 0; g < geometries.size(); g += test::kStep) {
    const auto& [name, geometry] = geometries[g];
    SCOPED_TRACE(name);
    const auto volume = test::sample<float>(onion, {11, 11, 11}, geometry);
    const Mesh whole = test::extracted(volume, {});
    const std::uint64_t count = measure_topology(whole, {}).components;
    ASSERT_GT(count, 3U);
    const double step = *std::ranges::min_element(geometry.spacing);
    // All of them in the first space, and one in each of the others.
    for (std::uint64_t n = g % count; n < count; n += g == 0 ? 1 : count) {
      expect_within_of(volume, {}, 0.2 * step, without(whole, ~(std::uint64_t{1} << n)));
    }
  }
}

TEST(BoundTest, HoldsInMillimetresForAnyGeometry) {
  const auto geometries = test::all_geometries();
  for (std::size_t g = 0; g < geometries.size(); g += test::kStep) {
    const auto& [name, geometry] = geometries[g];
    SCOPED_TRACE(name);
    const auto volume = test::noise<std::int16_t>({-3, 0, 1, 5}, {6, 7, 5}, 11, geometry);
    const double step = *std::ranges::min_element(geometry.spacing);
    expect_within(volume, {.iso = 1}, 0.2 * step);
  }
}

TEST(BoundTest, LeavesFewTrianglesOfAFlatSurface) {
  const auto volume = test::sample<float>(test::plane({0.6, 0.0, 0.8}, 17), {40, 40, 40});
  for (const Scheme scheme : test::kSchemes) {
    Mesh mesh = test::extracted(volume, {.scheme = scheme});
    const auto bound = simplified(volume, {.scheme = scheme}, {.max_error_mm = 0.1}, mesh);
    ASSERT_TRUE(bound);
    EXPECT_LT(mesh.triangles.size(), bound->triangles_before / 4);  // its boundary stays
  }
}

TEST(BoundTest, ProvesWhatWasSmoothedBefore) {
  const auto volume = test::sample<float>(test::gyroid(9), {14, 13, 12});
  for (const Scheme scheme : test::kSchemes) {
    const Mesh plain = test::extracted(volume, {.scheme = scheme});
    Mesh mesh = test::extracted(volume, {.scheme = scheme});
    smooth({.steps = test::means(5, {1}), .max_displacement_mm = 0.1}, {}, mesh);
    const auto bound =
        simplified(volume, {.scheme = scheme}, {.max_error_mm = 0.2, .is_smoothed = true}, mesh);
    ASSERT_TRUE(bound);
    EXPECT_LE(test::largest_distance(soup_of(mesh), soup_of(plain), 1000, 1), 0.2);
    EXPECT_LE(test::largest_distance(soup_of(plain), soup_of(mesh), 1000, 2), 0.2);
  }
}

TEST(BoundTest, StopsAtEnoughTriangles) {
  const auto volume = test::sample<float>(test::sphere({16, 16, 16}, 13), {33, 33, 33});
  Mesh mesh = test::extracted(volume, {});
  const std::uint64_t few = mesh.triangles.size() / 8;
  const auto bound = simplified(volume, {}, {.max_error_mm = 0.5, .triangles = few}, mesh);
  ASSERT_TRUE(bound);
  EXPECT_LE(mesh.triangles.size(), few + 2 * 27);  // each block stops by itself
  EXPECT_GE(mesh.triangles.size(), few - 2 * 27);
}

TEST(BoundTest, GivesTheSameMeshForAnyNumberOfThreads) {
  const auto volume = test::sample<float>(test::gyroid(17), {48, 44, 46});
  const auto make = [&] {
    Mesh mesh = test::extracted(volume, {});
    EXPECT_TRUE(simplified(volume, {}, {.max_error_mm = 0.1}, mesh));
    return mesh;
  };
  test::expect_same_on_any_threads(make, test::kSameBytes);
}

TEST(BoundTest, ClaimsNothingWhereItProvesNothing) {
  const auto volume = test::sample<float>(test::sphere({8, 8, 8}, 6.3), {17, 17, 17});
  Mesh mesh = test::extracted(volume, {});
  const std::size_t vertices = mesh.positions.size();
  EXPECT_FALSE(simplified(volume, {.iso = 1}, {.max_error_mm = 0.1}, mesh));  // another surface
  EXPECT_FALSE(simplified(volume, {.regularize = true}, {.max_error_mm = 0.1}, mesh));
  EXPECT_FALSE(simplified(volume, {}, {.max_error_mm = 0.1, .rounding_mm = 0.09}, mesh));
  EXPECT_EQ(mesh.positions.size(), vertices);
  // Samples too near to the iso-value for the limit.
  const auto beside = test::noise<double>({0.1, std::nextafter(0.1, 0.0), 1, -1}, {6, 7, 5}, 3);
  mesh = test::extracted(beside, {.iso = 0.1});
  EXPECT_FALSE(simplified(beside, {.iso = 0.1}, {.max_error_mm = 0.5}, mesh));
}

}  // namespace
}  // namespace isomesh::mesh
