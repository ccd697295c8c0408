#include "server/volume/labels.h"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <random>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "proto/samples.h"

namespace isomesh::volume::test {
namespace {

using Dims = std::array<std::uint32_t, 3>;

template <class Sample>
constexpr SampleType kTypeOf = SampleType::kUint8;
template <>
constexpr SampleType kTypeOf<std::int8_t> = SampleType::kInt8;
template <>
constexpr SampleType kTypeOf<std::uint16_t> = SampleType::kUint16;
template <>
constexpr SampleType kTypeOf<std::int16_t> = SampleType::kInt16;
template <>
constexpr SampleType kTypeOf<std::int32_t> = SampleType::kInt32;
template <>
constexpr SampleType kTypeOf<float> = SampleType::kFloat32;

template <class Sample>
std::optional<std::size_t> labels_of(const std::vector<Sample>& samples, const Dims& dims) {
  return label_count(std::as_bytes(std::span(samples)), kTypeOf<Sample>, dims);
}

// By the definition, pair by pair.
template <class Sample>
std::optional<std::size_t> reference(const std::vector<Sample>& samples, const Dims& dims) {
  std::size_t pairs = 0;
  std::size_t same = 0;
  for (std::size_t at = 0; at < samples.size(); ++at) {
    if (at % dims[0] == 0) continue;
    if (samples[at] == samples[0] && samples[at - 1] == samples[0]) continue;
    ++pairs;
    if (samples[at] == samples[at - 1]) ++same;
  }
  const std::size_t values = std::set(samples.begin(), samples.end()).size();
  if (values < 2 || values > 1024 || 10 * same < 6 * pairs) return std::nullopt;
  return values;
}

// Runs of one value that are about so long; the rows are longer than what is counted at once.
template <class Sample>
std::vector<Sample> runs(const Dims& dims, int values, double length, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<int> value(0, values - 1);
  std::bernoulli_distribution ends(1 / length);
  std::vector<Sample> samples(std::size_t{dims[0]} * dims[1] * dims[2]);
  // Over all of the type's range, its ends among them.
  const auto low = static_cast<double>(std::numeric_limits<Sample>::lowest());
  const auto high = static_cast<double>(std::numeric_limits<Sample>::max());
  auto now = Sample{0};
  for (Sample& sample : samples) {
    if (ends(random)) now = static_cast<Sample>(low + (high - low) * value(random) / (values - 1));
    sample = now;
  }
  return samples;
}

template <class Sample>
class LabelCount : public testing::Test {};
using Integers =
    testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t, std::int32_t>;
TYPED_TEST_SUITE(LabelCount, Integers);

TYPED_TEST(LabelCount, IsThatOfTheDefinition) {
  const Dims dims = {601, 7, 3};
  std::set<bool> answers;
  for (const int values : {2, 3, 40, 200}) {
    for (const double length : {1.5, 2.2, 2.6, 8.0, 40.0}) {
      for (unsigned seed = 0; seed < 3; ++seed) {
        const auto samples = runs<TypeParam>(dims, values, length, seed);
        const auto expected = reference(samples, dims);
        EXPECT_EQ(labels_of(samples, dims), expected) << values << ' ' << length << ' ' << seed;
        answers.insert(expected.has_value());
      }
    }
  }
  EXPECT_EQ(answers.size(), 2U) << "both answers have to come";
}

TEST(Labels, FlatImagesOfTooManyValuesAreNone) {
  std::vector<std::int16_t> samples;
  for (int value = 0; value < 1024; ++value) samples.insert(samples.end(), 8, std::int16_t(value));
  EXPECT_EQ(labels_of(samples, {8, 1024, 1}), 1024U);
  samples.insert(samples.end(), 8, std::int16_t{-1});
  EXPECT_EQ(labels_of(samples, {8, 1025, 1}), std::nullopt);
}

TEST(Labels, OfFloatsAreCountedAsTheirWholeNumbers) {
  const std::vector<float> samples = {0, 0.0005F, 0, 1, 0.9995F, 1.0005F, 2, 2, 1.9995F};
  EXPECT_EQ(labels_of(samples, {9, 1, 1}), 3U);
}

TEST(Labels, MayBeTwo) {
  const std::vector<std::uint8_t> samples = {1, 1, 1, 1, 2, 2, 2, 2};
  EXPECT_EQ(labels_of(samples, {8, 1, 1}), 2U);
  EXPECT_EQ(labels_of(std::vector<std::uint8_t>(8, 1), {8, 1, 1}), std::nullopt);
}

template <class Sample>
std::optional<std::int64_t> mask_of(const std::vector<Sample>& samples) {
  const auto [low, high] = std::ranges::minmax(samples);
  return mask_value(std::as_bytes(std::span(samples)), kTypeOf<Sample>,
                    {static_cast<double>(low), static_cast<double>(high)});
}

TYPED_TEST(LabelCount, AMaskIsZeroAndOneLargerValue) {
  std::vector<TypeParam> samples(10'000, 0);
  EXPECT_EQ(mask_of(samples), std::nullopt) << "all samples are equal";
  samples[9'000] = 1;
  EXPECT_EQ(mask_of(samples), 1);
  samples[9'999] = 2;
  EXPECT_EQ(mask_of(samples), std::nullopt) << "a third value";
  samples[9'000] = 2;
  EXPECT_EQ(mask_of(samples), 2);
  const TypeParam largest = std::numeric_limits<TypeParam>::max();
  samples[9'000] = samples[9'999] = largest;
  EXPECT_EQ(mask_of(samples), largest);
  std::ranges::replace(samples, TypeParam{0}, TypeParam{1});
  EXPECT_EQ(mask_of(samples), std::nullopt) << "no 0";
}

TEST(Mask, OfFloatsHasAWholeValue) {
  EXPECT_EQ(mask_of(std::vector<float>{0, 1, -0.0F, 1}), 1);
  EXPECT_EQ(mask_of(std::vector<float>{0, 255}), 255);
  EXPECT_EQ(mask_of(std::vector<float>{0, 0.9999F, -1e-7F, 1.0005F}), 1) << "nearly whole";
  EXPECT_EQ(mask_of(std::vector<float>{0, 0.998F}), std::nullopt);
  EXPECT_EQ(mask_of(std::vector<float>{0, 0.5}), std::nullopt);
  EXPECT_EQ(mask_of(std::vector<float>{0, 1, 0.5}), std::nullopt);
  EXPECT_EQ(mask_of(std::vector<float>{0, 1e30F}), std::nullopt);
  EXPECT_EQ(mask_of(std::vector<std::int16_t>{-1000, 0}), std::nullopt) << "0 is the larger one";
}

template <class Sample>
std::optional<SampleType> whole_type_of(const std::vector<Sample>& samples) {
  const auto found = whole_numbers(std::as_bytes(std::span(samples)), sample_type<Sample>());
  if (!found) return std::nullopt;
  return found->type;
}

TEST(WholeType, IsTheSmallestThatHoldsAllSamples) {
  const std::vector<std::pair<std::vector<double>, SampleType>> cases = {
      {{0, 255}, SampleType::kUint8},
      {{-0.0, 3}, SampleType::kUint8},
      {{-128, 127}, SampleType::kInt8},
      {{0, 256}, SampleType::kUint16},
      {{-1, 128}, SampleType::kInt16},
      {{-32768, 32767}, SampleType::kInt16},
      {{0, 65536}, SampleType::kUint32},
      {{0x1p31}, SampleType::kUint32},
      {{0xffffffffp0}, SampleType::kUint32},
      {{-1, 32768}, SampleType::kInt32},
      {{-0x1p31, 0x1p31 - 1}, SampleType::kInt32}};
  for (const auto& [samples, type] : cases) EXPECT_EQ(whole_type_of(samples), type) << samples[0];
  EXPECT_EQ(whole_type_of<float>({1, 70'000}), SampleType::kUint32);
  EXPECT_EQ(whole_type_of<std::int32_t>({1, 200}), SampleType::kUint8);
}

TEST(WholeType, IsNoneOfOtherNumbers) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  for (const double bad : {0.5, 1.0011, 0x1p32, -0x1p31 - 1, 1e300, kInfinity, -kInfinity, kNan}) {
    EXPECT_EQ(whole_type_of<double>({1, bad, 2}), std::nullopt) << bad;
  }
  EXPECT_EQ(whole_type_of<double>({-1, 0x1p31}), std::nullopt);
}

// As nibabel scales labels.
TEST(WholeNumbers, MayHaveToBeRounded) {
  const std::vector<double> samples = {-1.0005, 0, 0.99999999977, 2.9999999993};
  const auto bytes = std::as_bytes(std::span(samples));
  const auto found = whole_numbers(bytes, SampleType::kFloat64);
  ASSERT_TRUE(found);
  EXPECT_FALSE(found->is_exact);
  EXPECT_EQ(std::pair(found->low, found->high), std::pair(-1L, 3L));
  std::array<std::int8_t, 4> whole = {};
  store_whole(bytes, SampleType::kFloat64, found->type, reinterpret_cast<std::byte*>(whole.data()));
  EXPECT_EQ(whole, (std::array<std::int8_t, 4>{-1, 0, 1, 3}));
  const std::vector<double> exact = {-0.0, 7};
  EXPECT_TRUE(whole_numbers(std::as_bytes(std::span(exact)), SampleType::kFloat64)->is_exact);
}

TEST(DistinctValues, AreAscendingAndBounded) {
  const std::vector<float> samples = {7, -2, 7, 0.9995F, 1};
  const auto bytes = std::as_bytes(std::span(samples));
  EXPECT_EQ(distinct_values(bytes, SampleType::kFloat32, 3), (std::vector<std::int64_t>{-2, 1, 7}));
  EXPECT_EQ(distinct_values(bytes, SampleType::kFloat32, 2), std::nullopt);
  const std::vector<std::int8_t> small = {5, -128, 127, 5};
  EXPECT_EQ(distinct_values(std::as_bytes(std::span(small)), SampleType::kInt8, 9),
            (std::vector<std::int64_t>{-128, 5, 127}));
}

TEST(LabelTable, IsAscendingAndPlain) {
  const LabelEntry liver = {.label = 1, .name = "M\xc3\xbcller", .color = "#ff0000", .values = {}};
  const LabelEntry kidney = {.label = 7, .name = {}, .color = {}, .values = {-1, 7, 300}};
  EXPECT_TRUE(is_label_table({}));
  EXPECT_TRUE(is_label_table(std::vector{liver, kidney}));
  EXPECT_FALSE(is_label_table(std::vector{kidney, liver}));
  EXPECT_FALSE(is_label_table(std::vector{liver, liver}));
  EXPECT_FALSE(is_label_table(std::vector{LabelEntry{.label = 1, .values = {7, 7}}}));
  EXPECT_FALSE(is_label_table(std::vector{LabelEntry{.label = 1, .color = "red"}}));
  EXPECT_FALSE(is_label_table(std::vector{LabelEntry{.label = 1, .name = "a\nb"}}));
  EXPECT_TRUE(is_label_table(std::vector{LabelEntry{.label = 1, .name = std::string(255, 'x')}}));
  EXPECT_FALSE(is_label_table(std::vector{LabelEntry{.label = 1, .name = std::string(256, 'x')}}));
}

TEST(LabelTable, HasAtMostAsManyAsSixteenBitsTellApart) {
  std::vector<LabelEntry> labels(Volume::kMostLabels);
  for (std::size_t at = 0; at < labels.size(); ++at) {
    labels[at].label = static_cast<std::int64_t>(at);
  }
  EXPECT_TRUE(is_label_table(labels));
  labels.push_back({.label = 65535});
  EXPECT_FALSE(is_label_table(labels));
}

}  // namespace
}  // namespace isomesh::volume::test
