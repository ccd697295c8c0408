#include "server/volume/statistics.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace isomesh::volume::test {
namespace {

template <class Sample>
Statistics measured(const std::vector<Sample>& samples, SampleType type) {
  return measure(std::as_bytes(std::span(samples)), type);
}

// Otsu's threshold by its definition: every split tried on the samples themselves.
double plain_otsu(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  double best = -1;
  double threshold = values.front();
  for (std::size_t split = 1; split < values.size(); ++split) {
    if (values[split] == values[split - 1]) continue;
    double below = 0;
    double above = 0;
    for (std::size_t at = 0; at < values.size(); ++at) (at < split ? below : above) += values[at];
    const auto lower = static_cast<double>(split);
    const auto upper = static_cast<double>(values.size() - split);
    const double variance = lower * upper * std::pow(below / lower - above / upper, 2);
    if (variance <= best) continue;
    best = variance;
    threshold = (values[split - 1] + values[split]) / 2;
  }
  return threshold;
}

TEST(Statistics, LiesMidwayBetweenTwoValues) {
  const Statistics statistics =
      measured(std::vector<std::uint8_t>{0, 0, 0, 255, 0, 255}, SampleType::kUint8);
  EXPECT_EQ(statistics.range, (std::array<double, 2>{0, 255}));
  EXPECT_EQ(statistics.otsu, 127.5);
  EXPECT_EQ(measured(std::vector<std::int16_t>{-1000, -999}, SampleType::kInt16).otsu, -999.5);
}

// Copies of the smallest sample that stand for others have no weight.
template <class Sample>
double threshold_without(std::uint64_t left_out, SampleType type) {
  std::vector<Sample> samples(100 + left_out, Sample{10});
  for (std::size_t at = 0; at < 50; ++at) samples[at] = Sample{20};
  samples[60] = samples[61] = Sample{90};
  const Statistics statistics = measure(std::as_bytes(std::span(samples)), type, left_out);
  EXPECT_EQ(statistics.range, (std::array<double, 2>{10, 90}));
  return statistics.otsu;
}

TEST(Statistics, LeaveSamplesOutOfTheThreshold) {
  EXPECT_EQ(threshold_without<std::int16_t>(100'000, SampleType::kInt16), 55);
  EXPECT_EQ(threshold_without<std::int16_t>(0, SampleType::kInt16), 55);
  EXPECT_EQ(threshold_without<std::int32_t>(100'000, SampleType::kInt32), 55);
  EXPECT_EQ(threshold_without<float>(100'000, SampleType::kFloat32),
            threshold_without<float>(0, SampleType::kFloat32));
}

TEST(Statistics, OfIntegersIsExact) {
  std::vector<std::int16_t> samples;
  std::vector<double> values;
  for (int at = 0; at < 400; ++at) {
    const int value = at % 3 == 0 ? 900 + at * at % 71 : at * 7 % 113 - 200;
    samples.push_back(static_cast<std::int16_t>(value));
    values.push_back(value);
  }
  const double expected = plain_otsu(values);
  EXPECT_EQ(measured(samples, SampleType::kInt16).otsu, expected);
  const std::vector<std::int32_t> wide(samples.begin(), samples.end());
  EXPECT_EQ(measured(wide, SampleType::kInt32).otsu, expected);
  const std::vector<float> floats(samples.begin(), samples.end());
  EXPECT_NEAR(measured(floats, SampleType::kFloat32).otsu, expected, 1200.0 / 1024);
}

TEST(Statistics, OfAConstantVolumeIsItsValue) {
  const Statistics bytes = measured(std::vector<std::uint8_t>(9, 7), SampleType::kUint8);
  EXPECT_EQ(bytes.otsu, 7);
  EXPECT_EQ(bytes.range, (std::array<double, 2>{7, 7}));
  EXPECT_EQ(measured(std::vector<double>(9, -0.25), SampleType::kFloat64).otsu, -0.25);
  EXPECT_EQ(measured(std::vector<std::uint32_t>(9, 4294967295U), SampleType::kUint32).otsu,
            4294967295.0);
}

TEST(Statistics, CountsWhatIsNotFinite) {
  const float infinity = std::numeric_limits<float>::infinity();
  const Statistics some = measured(std::vector<float>{1, infinity, 3, std::nanf(""), -infinity, 2},
                                   SampleType::kFloat32);
  EXPECT_EQ(some.non_finite, 3U);
  EXPECT_EQ(some.range, (std::array<double, 2>{1, 3}));
  const Statistics none = measured(std::vector<float>(4, infinity), SampleType::kFloat32);
  EXPECT_EQ(none.non_finite, 4U);
  EXPECT_EQ(none.range, (std::array<double, 2>{0, 0}));
}

TEST(Statistics, StandsTheWidestAndTheNarrowestRanges) {
  const double largest = std::numeric_limits<double>::max();
  const Statistics wide =
      measured(std::vector<double>{-largest, largest, 0, largest}, SampleType::kFloat64);
  EXPECT_EQ(wide.range, (std::array<double, 2>{-largest, largest}));
  EXPECT_GT(wide.otsu, 0);
  EXPECT_LT(wide.otsu, largest);
  const double smallest = std::numeric_limits<double>::denorm_min();
  const Statistics narrow =
      measured(std::vector<double>{0, smallest, 2 * smallest}, SampleType::kFloat64);
  EXPECT_GE(narrow.otsu, 0);
  EXPECT_LE(narrow.otsu, 2 * smallest);
  const Statistics integers = measured(std::vector<std::int32_t>{std::numeric_limits<int>::min(), 0,
                                                                 std::numeric_limits<int>::max()},
                                       SampleType::kInt32);
  EXPECT_EQ(integers.range, (std::array<double, 2>{-2147483648.0, 2147483647.0}));
}

TEST(Histogram, CountsEverySampleWithinItsRangeOnce) {
  const std::vector<float> samples = {-1, 0, 0.5F, 1, 9.99F, 10, 11, std::nanf("")};
  const auto counts = histogram(std::as_bytes(std::span(samples)), SampleType::kFloat32,
                                {.range = {0, 10}, .count = 10});
  EXPECT_EQ(counts, (std::vector<std::uint64_t>{2, 1, 0, 0, 0, 0, 0, 0, 0, 2}));
  const auto constant = histogram(std::as_bytes(std::span(samples)), SampleType::kFloat32,
                                  {.range = {1, 1}, .count = 2});
  EXPECT_EQ(constant, (std::vector<std::uint64_t>{1, 0}));
}

}  // namespace
}  // namespace isomesh::volume::test
