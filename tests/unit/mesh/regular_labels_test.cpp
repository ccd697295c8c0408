#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/labels/label_surface.h"
#include "server/mesh/labels/separate.h"
#include "tests/support/any_threads.h"
#include "tests/support/regular_label_reference.h"
#include "tests/support/step.h"
#include "tests/unit/mesh/separated.h"

namespace isomesh::mesh {
namespace {

using test::SampleVolume;

SeparateOptions regularized(SeparateOptions options) {
  options.regularize = true;
  return options;
}

void expect_regular_walls(const SampleVolume<std::uint8_t>& volume,
                          const SeparateOptions& options) {
  SCOPED_TRACE(describe(volume.dims, options));
  const Lattice<std::uint8_t> lattice = volume.lattice();
  const test::RegularLabelReference reference = test::regular_label_reference(lattice, options);
  const SeparatingSurface plain = separated(volume, options);
  const SurfaceCount count = count_walls(lattice, regularized(options), {});
  const SeparatingSurface regular = separated(volume, regularized(options));
  EXPECT_EQ(regular.mesh.layer_triangles, count.layer_triangles);
  ASSERT_TRUE(test::matches(regular, plain, reference));
  ASSERT_TRUE(has_topology_of(regular, plain, reference));
  const auto counted = counted_triangles(lattice, regularized(options));
  const auto own = label_surfaces(regular, {});
  for (std::size_t n = 1; n < counted.size(); ++n) {
    EXPECT_EQ(counted[n], own[n - 1].triangles.size()) << "label " << n;
  }
}

void expect_regular_walls(const SampleVolume<std::uint8_t>& volume, std::size_t labels) {
  for (const SeparateOptions& options : all_separations(consecutive<std::int64_t>(1, labels))) {
    expect_regular_walls(volume, options);
    if (testing::Test::HasFailure()) return;
  }
}

// Two labels around every pattern of a block, then blocks of a few labels at random.
TEST(RegularLabels, OfBlocksAreTheReferences) {
  constexpr Dims kDims = {5, 4, 4};
  for (std::uint32_t seed = 0; seed < 2000 && !testing::Test::HasFailure(); seed += test::kStep) {
    SCOPED_TRACE(seed);
    auto volume = test::constant<std::uint8_t>(static_cast<std::uint8_t>(seed % 4), kDims);
    const std::size_t labels = 1 + seed % 4;
    const auto noise = label_noise(labels + 1, {3, 2, 2}, seed);
    for (std::uint32_t i = 0; i < 12; ++i) {
      volume.at(1 + i % 3, 1 + i / 3 % 2, 1 + i / 6) = noise.samples[i];
    }
    const auto all = all_separations(consecutive<std::int64_t>(1, 4));
    expect_regular_walls(volume, all[seed / 4 % all.size()]);
  }
}

TEST(RegularLabels, OfNoiseAreTheReferences) {
  for (std::uint32_t seed = 0; seed < 24 && !testing::Test::HasFailure(); seed += test::kStep) {
    SCOPED_TRACE(seed);
    const std::size_t labels = 1 + seed % 6;
    expect_regular_walls(label_noise(labels + 1, {4 + seed % 5, 4 + seed % 4, 4 + seed % 3}, seed),
                         labels);
  }
}

TEST(RegularLabels, OfCompactLabelsAreTheReferences) {
  for (std::uint32_t seed = 0; seed < 6 && !testing::Test::HasFailure(); seed += test::kStep) {
    SCOPED_TRACE(seed);
    expect_regular_walls(label_cells(3 + seed % 4, {14, 13, 12}, 7, seed), 3 + seed % 4);
    auto noisy = label_cells(4, {9, 8, 9}, 7, seed);
    const auto noise = label_noise(40, noisy.dims, seed);
    for (std::size_t i = 0; i < noise.samples.size(); ++i) {
      if (noise.samples[i] < 5) noisy.samples[i] = noise.samples[i];
    }
    expect_regular_walls(noisy, 4);
  }
}

// Labels that share values: each one's own surface is sound, and counted exactly.
TEST(RegularLabels, ThatOverlapAreManifolds) {
  for (std::uint32_t seed = 0; seed < 8; ++seed) {
    SCOPED_TRACE(seed);
    const auto volume =
        seed % 2 == 0 ? label_noise(5, {9, 8, 7}, seed) : label_cells(4, {14, 13, 12}, 7, seed);
    for (SeparateOptions options : all_separations({1, 2, 3})) {
      options.values = {{1, {1, 4}}, {2, {2, 4}}, {3, {3}}};
      const SeparatingSurface plain = separated(volume, options);
      const SeparatingSurface regular = separated(volume, regularized(options));
      const bool is_compact = seed % 2 == 1;  // noise is nothing but junctions
      EXPECT_TRUE(!is_compact || regular.mesh.triangles.size() < plain.mesh.triangles.size());
      const auto before = label_measures(plain);
      const auto after = label_measures(regular);
      const auto counted = counted_triangles(volume.lattice(), regularized(options));
      for (std::size_t n = 0; n < after.size(); ++n) {
        EXPECT_TRUE(after[n].topology.manifold && after[n].topology.oriented);
        EXPECT_EQ(after[n].topology.euler, before[n].topology.euler);
        EXPECT_EQ(after[n].topology.components, before[n].topology.components);
        EXPECT_EQ(after[n].is_closed(), before[n].is_closed());
        EXPECT_EQ(after[n].triangles, counted[n + 1]);
      }
    }
  }
}

TEST(RegularLabels, AcrossWordsAreTheReferences) {
  for (const std::uint32_t width : {62U, 63U, 64U, 65U, 66U, 129U}) {
    expect_regular_walls(label_noise(4, {width, 4, 4}, width), 3);
    if (testing::Test::HasFailure()) return;
  }
}

TEST(RegularLabels, OfTwoLabelsAreTheRegularSurfaceOfMidpoints) {
  const auto volume = label_noise(2, {21, 17, 15}, 3);
  const SeparatingSurface walls = separated(volume, regularized(SeparateOptions{{1}}));
  const ExtractOptions options = {
      .iso = 0.5, .interpolation = Interpolation::kMidpoint, .regularize = true};
  Mesh surface;
  test::extract_into(surface, volume, options);
  EXPECT_TRUE(test::same_bytes(walls.mesh, surface));
}

TEST(RegularLabels, HaveTheSameBytesOnEveryNumberOfThreads) {
  const auto volume = label_noise(5, {21, 17, 150}, 19);
  const auto all = all_separations({1, 2, 3, 4});
  for (std::size_t n = 0; n < all.size(); n += test::kStep) {
    const SeparateOptions options = regularized(all[n]);
    SCOPED_TRACE(describe(volume.dims, options));
    test::expect_same_on_any_threads([&] { return separated(volume, options); }, test::kSameBytes,
                                     {3, 16, 200});
    test::expect_same_on_any_threads([&] { return counted_triangles(volume.lattice(), options); });
  }
}

TEST(RegularLabels, OfCompactLabelsHaveAThirdOfTheTriangles) {
  const auto volume = label_cells(6, {48, 48, 48}, 30, 5);
  for (const Scheme scheme : {Scheme::kFive, Scheme::kSix}) {
    const SeparateOptions options = {consecutive<std::int64_t>(1, 6), scheme};
    EXPECT_LT(3 * separated(volume, regularized(options)).mesh.triangles.size(),
              separated(volume, options).mesh.triangles.size());
  }
}

}  // namespace
}  // namespace isomesh::mesh
