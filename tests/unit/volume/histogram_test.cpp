#include "server/volume/histogram.h"

#include <limits>
#include <numeric>
#include <random>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/volume/statistics.h"

namespace isomesh::volume::test {
namespace {

using testing::ElementsAre;

template <class Sample>
std::span<const std::byte> bytes_of(const std::vector<Sample>& samples) {
  return std::as_bytes(std::span(samples));
}

TEST(Histogram, OfFewIntegersHasAPlaceForEachValue) {
  const std::vector<std::int16_t> samples = {-3, -3, -1, 0, 2, 2, 2};
  ValueCounts values = no_values(SampleType::kInt16, {-3, 2});
  add_values(bytes_of(samples), SampleType::kInt16, values);
  EXPECT_TRUE(values.exact);
  EXPECT_THAT(values.counts, ElementsAre(2, 0, 1, 1, 0, 3));
  EXPECT_THAT(rebinned(values, 2), ElementsAre(3, 4));
  EXPECT_THAT(rebinned(values, 1), ElementsAre(7));
  EXPECT_THAT(rebinned(values, 6), ElementsAre(2, 0, 1, 1, 0, 3));
}

TEST(Histogram, IsThatOfTheSamplesThemselvesForAnyWidth) {
  std::mt19937 random(3);
  std::vector<std::uint16_t> samples(20'000);
  for (std::uint16_t& sample : samples) sample = static_cast<std::uint16_t>(100 + random() % 900);
  samples[0] = 100;
  samples[1] = 999;
  ValueCounts values = no_values(SampleType::kUint16, {100, 999});
  // In two parts, as several threads count.
  add_values(bytes_of(samples).first(10'000), SampleType::kUint16, values);
  add_values(bytes_of(samples).subspan(10'000), SampleType::kUint16, values);
  for (const std::size_t bins : {1U, 7U, 31U, 256U, 900U, 5000U}) {
    EXPECT_EQ(rebinned(values, bins),
              histogram(bytes_of(samples), SampleType::kUint16, {{100, 999}, bins}))
        << bins;
  }
}

TEST(Histogram, ValuesOnAnEdgeAreInTheBinAboveIt) {
  std::vector<std::uint16_t> samples(301);
  std::iota(samples.begin(), samples.end(), std::uint16_t{0});
  ValueCounts values = no_values(SampleType::kUint16, {0, 300});
  add_values(bytes_of(samples), SampleType::kUint16, values);
  for (const std::size_t bins : {2U, 30U, 75U, 100U, 150U, 300U}) {
    std::vector<std::uint64_t> expected(bins, 300 / bins);
    ++expected.back();  // the largest value
    EXPECT_EQ(rebinned(values, bins), expected) << bins;
    EXPECT_EQ(histogram(bytes_of(samples), SampleType::kUint16, {{0, 300}, bins}), expected)
        << bins;
  }
}

TEST(Histogram, OfFloatsIsRightToAPartOfTheRange) {
  std::mt19937 random(4);
  std::uniform_real_distribution<float> distribution(-1, 3);
  std::vector<float> samples(50'000);
  for (float& sample : samples) sample = distribution(random);
  samples[0] = -1;
  samples[1] = 3;
  samples[2] = std::numeric_limits<float>::quiet_NaN();
  ValueCounts values = no_values(SampleType::kFloat32, {-1, 3});
  add_values(bytes_of(samples), SampleType::kFloat32, values);
  EXPECT_FALSE(values.exact);
  // 256 bins are whole numbers of parts, so nothing is lost.
  EXPECT_EQ(rebinned(values, 256),
            histogram(bytes_of(samples), SampleType::kFloat32, {{-1, 3}, 256}));
  const auto odd = rebinned(values, 1000);
  EXPECT_EQ(std::accumulate(odd.begin(), odd.end(), std::uint64_t{0}), samples.size() - 1);
}

TEST(Histogram, OfWideIntegersIsCountedInParts) {
  const std::vector<std::int32_t> samples = {std::numeric_limits<std::int32_t>::min(), 0,
                                             std::numeric_limits<std::int32_t>::max()};
  ValueCounts values = no_values(SampleType::kInt32, {-2147483648.0, 2147483647.0});
  add_values(bytes_of(samples), SampleType::kInt32, values);
  EXPECT_FALSE(values.exact);
  EXPECT_EQ(values.counts.size(), 65536U);
  EXPECT_THAT(rebinned(values, 3), ElementsAre(1, 1, 1));
}

TEST(Histogram, OfAConstantOrExtremeVolumeIsOne) {
  const std::vector<std::uint8_t> same(10, 7);
  ValueCounts values = no_values(SampleType::kUint8, {7, 7});
  add_values(bytes_of(same), SampleType::kUint8, values);
  EXPECT_THAT(rebinned(values, 3), ElementsAre(10, 0, 0));
  const double most = std::numeric_limits<double>::max();
  const std::vector<double> extreme = {-most, 0, most};
  ValueCounts wide = no_values(SampleType::kFloat64, {-most, most});
  add_values(bytes_of(extreme), SampleType::kFloat64, wide);
  EXPECT_THAT(rebinned(wide, 2), ElementsAre(1, 2));
}

}  // namespace
}  // namespace isomesh::volume::test
