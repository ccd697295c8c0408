// No triangle of a mesh has zero area: the exact predicate of CGAL, on grids whose crossings lie on
// few places, so that the means of several often lie in line.
#include <cstdint>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/collapse/simplify.h"
#include "server/mesh/smooth/smooth.h"
#include "server/mesh/smooth/untangle.h"
#include "server/mesh/stairs/stairs.h"
#include "tests/support/kernels.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/shapes.h"
#include "tests/support/step.h"
#include "tests/unit/mesh/cgal_triangles.h"
#include "tests/unit/mesh/separated.h"

namespace isomesh::mesh {
namespace {

std::size_t flat_triangles(const Mesh& mesh) {
  std::size_t count = 0;
  for (const Triangle& triangle : mesh.triangles) {
    if (test::is_flat_for_cgal(mesh.positions.span(), triangle)) ++count;
  }
  return count;
}

// Grids of whole numbers from 0 on, some of them coarse.
template <class T>
test::SampleVolume<T> whole_numbers(std::uint32_t seed, const Geometry& geometry = {}) {
  const std::size_t values = 2 + seed % 7;
  return test::noise<T>(consecutive<T>(0, values), {10 + seed % 3, 9, 11}, seed, geometry);
}

std::vector<SmoothOptions> smoothings() {
  return {{},
          test::method_options(Smoothing::kLaplacian, 1),
          test::method_options(Smoothing::kLaplacian, 5),
          test::method_options(Smoothing::kTaubin, 3),
          test::method_options(Smoothing::kAngle, 2),
          test::method_options(Smoothing::kOptimize, 2)};
}

TEST(TriangleAreas, AreNotZeroAtHalfWayIsoValues) {
  for (std::uint32_t seed = 0; seed < 40; seed += test::kStep) {
    const auto volume =
        whole_numbers<std::int16_t>(seed, seed % 2 == 0 ? Geometry{} : test::oblique_geometry());
    for (const Scheme scheme : test::kSchemes) {
      const ExtractOptions options = {.iso = 0.5 + static_cast<double>(seed % 3 % (1 + seed % 7)),
                                      .scheme = scheme,
                                      .close = seed % 4 < 2,
                                      .regularize = seed % 5 != 0};
      const Mesh extracted = test::extracted(volume, options);
      for (const SmoothOptions& smoothing : smoothings()) {
        Mesh mesh = test::copy_of(extracted);
        smooth(smoothing, {}, mesh);
        if (seed % 6 == 1) untangle({.extracted = extracted.positions.span()}, {}, mesh);
        if (seed % 6 == 2) simplify({.triangles = mesh.triangles.size() / 2}, {}, mesh);
        EXPECT_EQ(flat_triangles(mesh), 0U)
            << "of " << mesh.triangles.size() << ", seed " << seed << ", scheme "
            << static_cast<int>(scheme) << ", " << smoothing.steps.size() << " steps";
      }
    }
  }
}

TEST(TriangleAreas, AreNotZeroBetweenLabels) {
  for (std::uint32_t seed = 0; seed < 60; seed += test::kStep) {
    const auto volume = seed % 2 == 0 ? label_cells(5 + seed % 40, {14, 13, 12}, 9, seed)
                                      : label_noise(2 + seed % 4, {9, 8, 10}, seed);
    SeparateOptions options = {.labels = consecutive<std::int64_t>(1, seed % 2 == 0 ? 20 : 3),
                               .scheme = seed % 3 == 0 ? Scheme::kFive : Scheme::kSix,
                               .close = seed % 4 < 2,
                               .regularize = true};
    SeparatingSurface walls = separated(volume, options);
    Mesh laplacian = test::copy_of(walls.mesh);
    smooth(test::method_options(Smoothing::kLaplacian, 3), {}, laplacian);
    EXPECT_EQ(flat_triangles(laplacian), 0U) << seed;
    Mesh plain = test::copy_of(walls.mesh);
    smooth({}, {}, plain);
    EXPECT_EQ(flat_triangles(plain), 0U) << seed;
    remove_stairs(volume.lattice(), options, std::numeric_limits<double>::infinity(), {}, walls);
    EXPECT_EQ(flat_triangles(walls.mesh), 0U)
        << "of " << walls.mesh.triangles.size() << ", seed " << seed;
  }
}

// Some triangles of this surface have all corners on junction curves, and in line.
TEST(TriangleAreas, AreNotZeroBetweenCurves) {
  const auto volume = label_noise(6, {9, 7, 40}, 101);
  const SeparateOptions options = {.labels = consecutive<std::int64_t>(1, 5),
                                   .scheme = Scheme::kSix,
                                   .close = false,
                                   .regularize = true};
  const SeparatingSurface walls = separated(volume, options);
  EXPECT_GT(flat_triangles(walls.mesh), 0U);
  for (const SmoothOptions& smoothing : smoothings()) {
    Mesh mesh = test::copy_of(walls.mesh);
    smooth(smoothing, {}, mesh);
    EXPECT_EQ(flat_triangles(mesh), 0U) << smoothing.steps.size() << " steps";
  }
}

}  // namespace
}  // namespace isomesh::mesh
