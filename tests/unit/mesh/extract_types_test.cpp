#include <cmath>
#include <limits>
#include <numeric>
#include <type_traits>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/extract/extract.h"
#include "tests/unit/mesh/reference_surface.h"

namespace isomesh::mesh {
namespace {

using test::SampleVolume;

// ---- Every type of sample

template <class T>
class ExtractFrom : public testing::Test {
 protected:
  static constexpr double kLow = std::numeric_limits<T>::lowest();
  static constexpr double kHigh = std::numeric_limits<T>::max();

  // Seven values around 3, or around 0 where there are negative ones.
  static std::vector<T> few_values() {
    std::vector<T> values(7);
    std::iota(values.begin(), values.end(), static_cast<T>(few_values_iso() - 3));
    return values;
  }
  static int few_values_iso() { return std::is_signed_v<T> ? 0 : 3; }

  static SampleVolume<T> wide_noise(const Dims& dims, std::uint64_t seed) {
    if (std::is_integral_v<T>) return test::noise_between<T>(kLow, kHigh, dims, seed);
    return test::noise_between<T>(-1000, 1000, dims, seed);
  }
  static double wide_noise_iso() {
    return std::is_integral_v<T> ? kLow * 0.6 + kHigh * 0.4 + 0.25 : -12.625;
  }
};

using SampleTypes = testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                                   std::uint32_t, std::int32_t, float, double>;
TYPED_TEST_SUITE(ExtractFrom, SampleTypes);

TYPED_TEST(ExtractFrom, NoiseOfEveryWidthIsTheReferencesSurface) {
  for (const std::uint32_t width : {2U, 3U, 5U, 31U, 62U, 63U, 64U, 65U, 66U, 127U, 128U, 129U}) {
    expect_reference_surfaces(this->wide_noise({width, 4, 3}, width), this->wide_noise_iso());
  }
}

TYPED_TEST(ExtractFrom, SamplesThatEqualTheIsoValueAreTheReferencesSurface) {
  for (const Dims dims : {Dims{63, 3, 4}, Dims{64, 4, 3}, Dims{65, 3, 3}, Dims{130, 3, 3}}) {
    const auto volume = test::noise(this->few_values(), dims, dims.x);
    expect_reference_surfaces(volume, this->few_values_iso());
    expect_reference_surfaces(volume, this->few_values_iso() - 0.5);
  }
}

TYPED_TEST(ExtractFrom, ThinVolumesAreTheReferencesSurface) {
  for (const Dims dims : {Dims{2, 9, 8}, Dims{9, 2, 8}, Dims{9, 8, 2}, Dims{2, 2, 2}, Dims{2, 2, 9},
                          Dims{2, 9, 2}, Dims{65, 2, 2}, Dims{128, 2, 2}, Dims{3, 3, 40}}) {
    expect_reference_surfaces(this->wide_noise(dims, 7), this->wide_noise_iso());
  }
}

TYPED_TEST(ExtractFrom, VolumesWithoutCellsHaveNoSurface) {
  for (const Dims dims :
       {Dims{1, 9, 8}, Dims{9, 1, 8}, Dims{9, 8, 1}, Dims{70, 1, 1}, Dims{1, 1, 1}, Dims{0, 0, 0},
        Dims{0, 5, 5}, Dims{5, 0, 5}, Dims{5, 5, 0}}) {
    expect_empty(this->wide_noise(dims, 8), this->wide_noise_iso());
  }
}

TYPED_TEST(ExtractFrom, AnIsoValueOutsideTheRangeHasNoSurface) {
  auto volume = test::noise(this->few_values(), {66, 5, 4}, 9);
  for (const double iso : {-1e300, -1e12, -3.5, 6.5, 300.0, 1e6, 1e12, 1e300}) {
    expect_empty(volume, iso);
  }
}

TYPED_TEST(ExtractFrom, IsoValuesAtTheEndsOfTheTypeAreTheReferencesSurface) {
  using T = TypeParam;
  const std::vector<T> values = {std::numeric_limits<T>::lowest(), std::numeric_limits<T>::max(),
                                 T{0}, T{1}};
  const auto volume = test::noise(values, {65, 4, 4}, 10);
  expect_reference_surfaces(volume, this->kHigh);
  expect_reference_surfaces(volume, 0.5);
  expect_reference_surfaces(volume, 1);
  expect_empty(volume, this->kLow);
  if (std::is_integral_v<T>) {
    expect_reference_surfaces(volume, this->kHigh - 0.5);
    expect_reference_surfaces(volume, this->kLow + 0.5);
    expect_empty(volume, this->kHigh + 0.5);
    expect_empty(volume, this->kLow - 0.5);
  }
}

TYPED_TEST(ExtractFrom, ACheckerboardIsTheReferencesSurface) {
  using T = TypeParam;
  expect_reference_surfaces(test::checkerboard<T>(T{1}, T{5}, {66, 5, 6}), 2.5);
  expect_reference_surfaces(test::checkerboard<T>(T{5}, T{1}, {66, 5, 6}), 5);
}

TYPED_TEST(ExtractFrom, AConstantVolumeHasNoSurface) {
  using T = TypeParam;
  const auto volume = test::constant<T>(T{42}, {65, 5, 6});
  expect_empty(volume, 42);
  expect_empty(volume, 41.5);
  expect_empty(volume, 42.5);
}

TYPED_TEST(ExtractFrom, SmoothShapesAreTheReferencesSurface) {
  const test::Field torus = test::torus({10, 9, 6}, 6, 2.5);
  const auto volume = test::sample<TypeParam>(test::scaled(torus, 9, 60), {21, 20, 13});
  expect_reference_surfaces(volume, 60);
  expect_reference_surfaces(volume, 61.5);
}
// ---- Values that floating point finds hard

TEST(ExtractFloats, ExtremesAreTheReferencesSurface) {
  using Limits = std::numeric_limits<float>;
  const std::vector<float> values = {Limits::lowest(),
                                     Limits::max(),
                                     -1e38F,
                                     1e38F,
                                     Limits::denorm_min(),
                                     -Limits::denorm_min(),
                                     1e-40F,
                                     -1e-40F,
                                     0.0F,
                                     -0.0F,
                                     1e-30F,
                                     -1e-30F,
                                     1.0F,
                                     -1.0F};
  const auto volume = test::noise(values, {65, 6, 6}, 11);
  for (const double iso : {0.0, 1e-40, -1e-40, 1e-30, 1e-300, 1.0, 0.1, 1e38, -1e38}) {
    expect_reference_surfaces(volume, iso);
  }
}

TEST(ExtractDoubles, LargeAndSmallValuesAreTheReferencesSurface) {
  const std::vector<double> values = {-1e300, 1e300, 1e-300, -0.0, 0.0, 1e-30, -1e-30, 1.0, -1.0};
  const auto volume = test::noise(values, {65, 6, 6}, 12);
  for (const double iso : {0.0, 1e-300, 1e-30, -1e-30, 1.0, 0.1, 1e300, -1e299}) {
    expect_reference_surfaces(volume, iso);
  }
}

TEST(ExtractDoubles, SubnormalValuesAreTheReferencesSurface) {
  const double least = std::numeric_limits<double>::denorm_min();
  const std::vector<double> values = {least, -least, 3 * least, 1e-310, -1e-310, 0.0, -0.0};
  const auto volume = test::noise(values, {65, 6, 6}, 24);
  for (const double iso : {0.0, least, 1e-310}) expect_reference_surfaces(volume, iso);
}

TEST(ExtractDoubles, DifferencesThatOverflowAreTheReferencesSurface) {
  using Limits = std::numeric_limits<double>;
  const std::vector<double> values = {Limits::lowest(), Limits::max(), -1e308, 1e308, 0.0, 1.0};
  const auto volume = test::noise(values, {65, 6, 6}, 22);
  for (const double iso : {0.0, 1.0, 1e308, -1e308}) {
    expect_reference_surfaces(volume, iso);
  }
}

TEST(ExtractFloats, AnIsoValueBetweenTwoFloatsDividesThem) {
  const float above = std::nextafter(1.0F, 2.0F);
  const auto volume = test::noise<float>({1.0F, above}, {65, 5, 5}, 13);
  expect_reference_surfaces(volume, 1 + 1e-9);
  expect_reference_surfaces(volume, above);
  expect_empty(volume, 1);
  expect_empty(volume, above + 1e-9);
}

TEST(ExtractFloats, ValuesNextToTheIsoValueKeepVerticesOffTheSamples) {
  const std::vector<float> values = {1e-30F, -1e-30F, 1.0F, -1.0F, 0.0F};
  expect_reference_surfaces(test::noise(values, {65, 6, 6}, 14), 0);
}

TEST(ExtractUint32, DistinguishesLargeNeighbours) {
  const std::vector<std::uint32_t> values = {4294967290U, 4294967291U, 4294967293U, 4294967295U};
  const auto volume = test::noise(values, {65, 5, 5}, 15);
  expect_reference_surfaces(volume, 4294967292.25);
  expect_reference_surfaces(volume, 4294967293.0);
}

TEST(ExtractInt32, DistinguishesLargeNeighbours) {
  const std::vector<std::int32_t> values = {-2147483648, -2147483647, -2147483645, -2147483643};
  const auto volume = test::noise(values, {65, 5, 5}, 16);
  expect_reference_surfaces(volume, -2147483645.75);
  expect_reference_surfaces(volume, -2147483645.0);
}

}  // namespace
}  // namespace isomesh::mesh
