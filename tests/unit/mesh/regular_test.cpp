// Surfaces that are regularised: what is joined, and that the topology stays.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/extract/extract.h"
#include "tests/support/any_threads.h"
#include "tests/support/step.h"
#include "tests/unit/mesh/reference_surface.h"

namespace isomesh::mesh {
namespace {

using test::SampleVolume;

std::vector<ExtractOptions> all_ways(double iso) {
  std::vector<ExtractOptions> ways = all_options(iso, false);
  for (const ExtractOptions& closed : all_options(iso, true)) ways.push_back(closed);
  return ways;
}

// All ways at one iso-value. Stops at the first that fails.
template <class T>
void expect_regular_surfaces(const SampleVolume<T>& volume, double iso) {
  for (const ExtractOptions& options : all_ways(iso)) {
    expect_regular_surface(volume, options);
    if (testing::Test::HasFailure()) return;
  }
}

constexpr Dims kPatternDims = {5, 4, 4};

// A block of 3 x 2 x 2 samples whose signs are the bits of `pattern`, in a layer of others outside.
// All distances from 0 are 1 to `distances`: few of them make ties.
SampleVolume<std::int8_t> block(unsigned pattern, unsigned distances, std::mt19937& random) {
  auto volume = test::constant<std::int8_t>(0, kPatternDims);
  for (std::int8_t& sample : volume.samples) {
    sample = static_cast<std::int8_t>(-1 - static_cast<int>(random() % distances));
  }
  for (unsigned bit = 0; bit < 12; ++bit) {
    std::int8_t& sample = volume.at(1 + bit % 3, 1 + bit / 3 % 2, 1 + bit / 6);
    if ((pattern >> bit & 1) != 0) sample = static_cast<std::int8_t>(-sample);
  }
  return volume;
}

TEST(RegularSurface, OfEveryPatternOfABlockIsTheReferences) {
  std::mt19937 random(1);
  for (unsigned pattern = 0; pattern < 1U << 12 && !testing::Test::HasFailure();
       pattern += test::kStep) {
    SCOPED_TRACE(pattern);
    auto volume = block(pattern, pattern % 3 == 0 ? 1 : pattern % 3 == 1 ? 3 : 100, random);
    // The other side is inside, for half of them.
    const bool turned = (random() & 1) != 0;
    for (std::int8_t& sample : volume.samples) {
      sample = static_cast<std::int8_t>(turned ? -sample : sample);
    }
    const Scheme scheme = (random() & 1) != 0 ? Scheme::kFive : Scheme::kSix;
    expect_regular_surface(volume, {0, scheme, Interpolation::kLinear});
  }
}

class RegularCells : public testing::TestWithParam<std::tuple<test::Parity, test::Surround>> {};

TEST_P(RegularCells, AreTheReferences) {
  const auto& [parity, surround] = GetParam();
  for (unsigned pattern = 0; pattern < 256 && !HasFailure(); ++pattern) {
    SCOPED_TRACE(pattern);
    const std::vector<ExtractOptions> ways = all_ways(test::kPatternIso);
    expect_regular_surface(test::sign_pattern<std::uint8_t>(pattern, parity, surround),
                           ways[pattern % ways.size()]);
  }
}

INSTANTIATE_TEST_SUITE_P(Cells, RegularCells,
                         testing::Combine(testing::Values(test::Parity::kEven, test::Parity::kOdd),
                                          testing::Values(test::Surround::kOutside,
                                                          test::Surround::kInside)));

TEST(RegularSurface, OfNoiseAndPlateausIsTheReferences) {
  for (std::uint32_t seed = 0; seed < 12 && !testing::Test::HasFailure(); seed += test::kStep) {
    SCOPED_TRACE(seed);
    const Dims dims = {4 + seed % 5, 4 + seed % 4, 4 + seed % 3};
    expect_regular_surfaces(test::noise_between<float>(-1, 1, dims, seed), 0);
    expect_regular_surfaces(test::noise<std::uint8_t>({0, 1, 2, 3, 4}, dims, seed), 2);
    expect_regular_surfaces(test::noise<std::uint8_t>({0, 0, 0, 0, 0, 1, 2}, dims, seed), 1);
    expect_regular_surfaces(test::noise<std::uint8_t>({2, 2, 2, 2, 2, 1, 0}, dims, seed), 0.25);
  }
}

TEST(RegularSurface, OfThinShellsIsTheReferences) {
  for (std::uint32_t seed = 0; seed < 12 && !testing::Test::HasFailure(); seed += test::kStep) {
    SCOPED_TRACE(seed);
    expect_regular_surfaces(test::thin_shell(seed), 0);
  }
}

TEST(RegularSurface, AcrossWordsIsTheReferences) {
  for (const std::uint32_t width : {62U, 63U, 64U, 65U, 66U, 129U}) {
    const std::vector<std::int16_t> values = {-9, -8, -7, -1, 0, 1, 2, 7};
    expect_regular_surfaces(test::noise(values, {width, 4, 4}, width), 0);
    if (testing::Test::HasFailure()) return;
  }
}

template <class T>
class RegularFrom : public testing::Test {};
using SampleTypes = testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                                   std::uint32_t, std::int32_t, float, double>;
TYPED_TEST_SUITE(RegularFrom, SampleTypes);

// The distances of the largest doubles from each other are more than a double can be.
TYPED_TEST(RegularFrom, ValuesOfTheWholeRangeIsTheReferences) {
  using Limits = std::numeric_limits<TypeParam>;
  const std::vector<TypeParam> values = {
      Limits::lowest(), Limits::max(), Limits::max() / 2, Limits::lowest() / 2, 0, 1, 2, 3, 4};
  for (const double iso : {1.0, 2.5, static_cast<double>(Limits::max() / 3)}) {
    expect_regular_surfaces(test::noise(values, {7, 6, 5}, 11), iso);
  }
}

TEST(RegularSurface, OfSmallVolumesIsThePlainOne) {
  for (const Dims dims : {Dims{2, 2, 2}, Dims{2, 9, 9}, Dims{9, 2, 9}, Dims{9, 9, 2}}) {
    const auto volume = test::noise<std::uint8_t>({0, 1, 2}, dims, 5);
    for (const ExtractOptions& options : all_options(1)) {
      EXPECT_TRUE(test::same_bytes(test::extracted(volume, options),
                                   test::extracted(volume, regularized(options))));
    }
  }
}

TEST(RegularSurface, HasTheSameBytesOnEveryNumberOfThreads) {
  const auto noise = test::noise<std::uint8_t>({0, 40, 80, 120, 160}, {21, 17, 150}, 19);
  for (const bool close : {false, true}) {
    for (const ExtractOptions& plain : all_options(80, close)) {
      const ExtractOptions options = regularized(plain);
      SCOPED_TRACE(describe(noise.dims, options));
      const Mesh single = test::expect_same_on_any_threads(
          [&] { return test::extracted(noise, options); }, test::kSameBytes, {3, 16, 200});
      EXPECT_LT(single.triangles.size(), test::extracted(noise, plain).triangles.size());
    }
  }
}

TEST(RegularSurface, OfABallHasAThirdOfTheTriangles) {
  const auto volume = test::sample<float>(test::sphere({24, 24, 24}, 20), {49, 49, 49});
  for (const Scheme scheme : {Scheme::kFive, Scheme::kSix}) {
    const ExtractOptions options = {0.1, scheme, Interpolation::kLinear};
    const Mesh plain = test::extracted(volume, options);
    const Mesh regular = test::extracted(volume, regularized(options));
    EXPECT_LT(3 * regular.triangles.size(), plain.triangles.size());
    EXPECT_TRUE(test::is_sound(test::surface_of(regular)));
    for (const Vec3& position : regular.positions) {
      EXPECT_NEAR(std::hypot(position[0] - 24, position[1] - 24, position[2] - 24), 19.9, 0.03);
    }
  }
}

}  // namespace
}  // namespace isomesh::mesh
