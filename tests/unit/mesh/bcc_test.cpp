// Extraction on the body-centred lattice.
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/extract/extract.h"
#include "server/mesh/labels/separate.h"
#include "tests/support/any_threads.h"
#include "tests/support/errors.h"
#include "tests/support/kernels.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/shapes.h"
#include "tests/support/step.h"
#include "tests/unit/mesh/reference_surface.h"

namespace isomesh::mesh {
namespace {

using test::SampleVolume;

std::vector<ExtractOptions> bcc_options(double iso) {
  return {{iso, Scheme::kBcc, Interpolation::kLinear, false},
          {iso, Scheme::kBcc, Interpolation::kMidpoint, false},
          {iso, Scheme::kBcc, Interpolation::kLinear, true},
          {iso, Scheme::kBcc, Interpolation::kMidpoint, true}};
}

template <class T>
void expect_bcc_surface(const SampleVolume<T>& volume, const ExtractOptions& options) {
  ASSERT_NO_FATAL_FAILURE(expect_reference_surface(volume, options));
  expect_regular_surface(volume, options);
}

// All ways to extract. Stops at the first that fails.
template <class T>
void expect_bcc_surfaces(const SampleVolume<T>& volume, double iso) {
  for (const ExtractOptions& options : bcc_options(iso)) {
    expect_bcc_surface(volume, options);
    if (testing::Test::HasFailure()) return;
  }
}

SampleVolume<std::int16_t> pattern_volume(unsigned pattern, const Dims& dims) {
  auto volume = test::constant<std::int16_t>(-3, dims);
  for (std::size_t n = 0; n < volume.samples.size(); ++n) {
    if ((pattern >> n & 1) != 0) volume.samples[n] = 5;
  }
  return volume;
}

TEST(BccPatterns, OfOneCellAreTheReferencesSurface) {
  for (unsigned pattern = 0; pattern < 256 && !testing::Test::HasFailure(); ++pattern) {
    SCOPED_TRACE(pattern);
    expect_bcc_surfaces(pattern_volume(pattern, {2, 2, 2}), 0);
    expect_bcc_surfaces(pattern_volume(pattern, {2, 2, 2}), 1);  // four of eight have this mean
  }
}

TEST(BccPatterns, OfTwoCellsAreTheReferencesSurface) {
  for (unsigned pattern = 0; pattern < 4096 && !testing::Test::HasFailure();
       pattern += test::kStep) {
    SCOPED_TRACE(pattern);
    const Interpolation linear = Interpolation::kLinear;
    expect_bcc_surface(pattern_volume(pattern, {3, 2, 2}), {0, Scheme::kBcc, linear});
    expect_bcc_surface(pattern_volume(pattern, {2, 3, 2}), {0, Scheme::kBcc, linear});
    expect_bcc_surface(pattern_volume(pattern, {2, 2, 3}), {0, Scheme::kBcc, linear});
    expect_bcc_surface(pattern_volume(pattern, {3, 2, 2}), {0, Scheme::kBcc, linear, true});
  }
}

template <class T>
class BccFrom : public testing::Test {};

using SampleTypes = testing::Types<std::int8_t, std::uint8_t, std::int16_t, std::uint16_t,
                                   std::int32_t, std::uint32_t, float, double>;
TYPED_TEST_SUITE(BccFrom, SampleTypes);

TYPED_TEST(BccFrom, NoiseIsTheReferencesSurface) {
  using T = TypeParam;
  std::uint64_t seed = 100;
  constexpr std::array kDims = {Dims{9, 2, 3},  Dims{9, 9, 9},  Dims{2, 2, 9},
                                Dims{65, 4, 3}, Dims{4, 5, 6},  Dims{3, 9, 2},
                                Dims{64, 3, 4}, Dims{66, 3, 3}, Dims{129, 3, 3}};
  // The sizes show the same for each type of samples, so most types have a third of them.
  constexpr bool kIsForAll = std::is_same_v<T, std::uint8_t> || std::is_same_v<T, float>;
  constexpr std::size_t kEvery = test::kStep * (kIsForAll ? 1 : 3);
  for (std::size_t n = sizeof(T) % kEvery; n < kDims.size(); n += kEvery) {
    const Dims& dims = kDims[n];
    expect_bcc_surfaces(test::noise<T>({T{0}, T{1}, T{2}, T{3}, T{7}}, dims, ++seed), 2);
    expect_bcc_surfaces(test::noise_between<T>(0, 100, dims, ++seed), 50.5);
    // Plateaus: many centres have the iso-value itself.
    expect_bcc_surfaces(test::noise<T>({T{0}, T{4}, T{8}}, dims, ++seed), 4);
    if (testing::Test::HasFailure()) return;
  }
}

TYPED_TEST(BccFrom, SumsOfExtremesAreExact) {
  using T = TypeParam;
  const T low = std::numeric_limits<T>::lowest();
  const T high = std::numeric_limits<T>::max();
  const auto volume = test::noise<T>({low, high, T{0}, T{1}}, {9, 7, 6}, 300);
  for (const double iso : {0.0, 1.0, 0.125, static_cast<double>(high)}) {
    expect_bcc_surfaces(volume, iso);
  }
}

TYPED_TEST(BccFrom, MeansOnTheIsoValueAreInside) {
  using T = TypeParam;
  auto volume = test::constant<T>(T{0}, {2, 2, 2});
  volume.samples[3] = T{1};
  // The centre is inside at a mean of 1/8, and then all its edges to corners but one are crossed.
  const auto vertices = [&](double iso) {
    return count_surface(volume.lattice(), {.iso = iso, .scheme = Scheme::kBcc}, {}).vertices();
  };
  EXPECT_GT(vertices(0.125), vertices(std::nextafter(0.125, 1.0)));
}

TEST(BccFloats, TheSignIsTakenBeforeTheMeanIsRounded) {
  // The mean is 1 - 2^-26: below the iso-value in double, equal to it in single precision.
  auto volume = test::constant<float>(1, {2, 2, 2});
  volume.samples[0] = 1 - 0x1p-23F;
  const ExtractOptions options = {.iso = 1, .scheme = Scheme::kBcc};
  const auto reference = test::scalar_surface(test::in_doubles(volume).lattice(), options);
  const SurfaceCount count = count_surface(volume.lattice(), options, {});
  EXPECT_EQ(count.vertices(), reference.vertices.size());
  volume.samples[0] = 1;
  EXPECT_EQ(count_surface(volume.lattice(), options, {}).vertices(), 0U);
  // Seven edges lead from an outside centre to inside corners.
  EXPECT_GE(count.vertices(), 7U);
}

class BccInGeometry : public testing::TestWithParam<test::NamedGeometry> {};

TEST_P(BccInGeometry, NoiseIsTheReferencesSurface) {
  const std::vector<std::int16_t> values = {-700, -20, -3, 0, 1, 40, 900};
  expect_bcc_surfaces(test::noise(values, {11, 9, 8}, 17, GetParam().geometry), 0.5);
}

TEST_P(BccInGeometry, SamplesThatEqualTheIsoValueGiveASoundSurface) {
  const auto volume = test::noise<std::uint8_t>({0, 1, 2}, {21, 13, 15}, 18, GetParam().geometry);
  for (const ExtractOptions& options : bcc_options(1)) {
    EXPECT_TRUE(test::is_sound(test::surface_of(test::extracted(volume, options))));
  }
}

TEST_P(BccInGeometry, AClosedBoxIsTheBoxOfTheOuterSamples) {
  auto volume = test::constant<std::uint8_t>(200, {5, 4, 6});
  volume.geometry = GetParam().geometry;
  const LatticeToSpace map = test::space_of(volume.geometry);
  const double box = 4 * 3 * 5 * std::abs(map.determinant());
  for (const Interpolation way : {Interpolation::kLinear, Interpolation::kMidpoint}) {
    const test::Surface surface =
        test::surface_of(test::extracted(volume, {100, Scheme::kBcc, way, true}));
    EXPECT_EQ(test::topology_of(surface).euler, 2);
    EXPECT_NEAR(test::extent_of(surface, map.origin).volume, box, 1e-4 * box);
  }
}

INSTANTIATE_TEST_SUITE_P(Geometries, BccInGeometry, testing::ValuesIn(test::all_geometries()),
                         [](const auto& test) { return test.param.name; });

TEST(BccShapes, HaveTheirComponentsAndTheirEulerNumber) {
  const std::uint32_t n = 33;
  const auto facts = [&](const test::Field& field) {
    const auto volume =
        test::sample<double>(field, test::unit_cube_dims(n), test::unit_cube_geometry(n));
    const test::Surface surface =
        test::surface_of(test::extracted(volume, {0, Scheme::kBcc, Interpolation::kLinear}));
    EXPECT_TRUE(test::is_sound(surface));
    return test::topology_of(surface);
  };
  const test::TopologyFacts sphere = facts(test::sphere({0.03, -0.02, 0.05}, 0.73));
  EXPECT_EQ(sphere.components, 1U);
  EXPECT_EQ(sphere.euler, 2);
  const test::TopologyFacts torus = facts(test::torus({0.02, 0.03, -0.04}, 0.6, 0.27));
  EXPECT_EQ(torus.components, 1U);
  EXPECT_EQ(torus.euler, 0);
  const test::TopologyFacts tangle = facts(test::tangle_cube(2.6));
  EXPECT_EQ(tangle.components, 1U);
  EXPECT_EQ(tangle.euler, 2 - 2 * 5);
}

TEST(BccRegular, ThinShellsAreTheReferences) {
  for (std::uint32_t seed = 0; seed < 8 && !testing::Test::HasFailure(); seed += test::kStep) {
    SCOPED_TRACE(seed);
    expect_bcc_surfaces(test::thin_shell(seed), 0);
  }
}

TEST(BccRegular, BallHasAThirdOfTheTriangles) {
  const auto volume = test::sample<float>(test::sphere({24, 24, 24}, 20), {49, 49, 49});
  ExtractOptions options = {0.1, Scheme::kBcc, Interpolation::kLinear};
  const Mesh plain = test::extracted(volume, options);
  options.regularize = true;
  const Mesh regular = test::extracted(volume, options);
  EXPECT_LT(3 * regular.triangles.size(), plain.triangles.size());
  EXPECT_TRUE(test::is_sound(test::surface_of(regular)));
  for (const Vec3& position : regular.positions) {
    EXPECT_NEAR(std::hypot(position[0] - 24, position[1] - 24, position[2] - 24), 19.9, 0.03);
  }
}

TEST(BccThreads, GiveTheSameBytes) {
  const auto volume = test::noise<std::uint8_t>({0, 40, 80, 120, 160}, {21, 17, 75}, 19);
  std::vector<ExtractOptions> ways = bcc_options(80);
  for (ExtractOptions options : bcc_options(80)) {
    options.regularize = true;
    ways.push_back(options);
  }
  for (const ExtractOptions& options : ways) {
    test::expect_same_on_any_threads([&] { return test::extracted(volume, options); },
                                     test::kSameBytes);
  }
}

TEST(BccRefusals, NameTheSchemesThatThereAre) {
  const auto volume = test::constant<std::uint8_t>(1, {3, 3, 3});
  const auto labels = test::thrown_by(
      [&] { count_walls(volume.lattice(), {.labels = {1}, .scheme = Scheme::kBcc}, {}); });
  ASSERT_TRUE(labels);
  EXPECT_EQ(labels->code(), ErrorCode::kInvalidParameter);
  EXPECT_STREQ(labels->what(), "labels cannot be extracted with scheme bcc; use 5 or 6");
}

}  // namespace
}  // namespace isomesh::mesh
