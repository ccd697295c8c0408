#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/samples.h"
#include "tests/unit/import/files.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using testing::HasSubstr;

template <class Sample>
class RawOfType : public testing::Test {};
using Samples = testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                               std::uint32_t, std::int32_t, float, double>;
TYPED_TEST_SUITE(RawOfType, Samples);

// More samples than are converted at a time, so that pieces meet.
TYPED_TEST(RawOfType, IsReadInBothByteOrders) {
  RawDescription description;
  description.dims = {67, 51, 83};
  description.type = sample_type<TypeParam>();
  const auto samples = some_samples<TypeParam>(67 * 51 * 83);
  for (const bool big_endian : {false, true}) {
    description.big_endian = big_endian;
    const Outcome outcome = imported(import_raw_bytes(bytes_of(samples, big_endian), description));
    EXPECT_EQ(samples_of<TypeParam>(outcome), samples);
    EXPECT_EQ(outcome.volume.type, description.type);
    EXPECT_EQ(outcome.volume.format, "raw");
    EXPECT_EQ(outcome.volume.bytes, samples.size() * sizeof(TypeParam));
    const auto [low, high] = std::minmax_element(samples.begin(), samples.end());
    EXPECT_EQ(outcome.volume.range[0], static_cast<double>(*low));
    EXPECT_EQ(outcome.volume.range[1], static_cast<double>(*high));
  }
}

RawDescription small_description() {
  RawDescription description;
  description.dims = {4, 3, 2};
  return description;
}

TEST(Raw, IsRefusedWithBothSizesWhenTheyDiffer) {
  for (const std::size_t size : {0, 1, 23, 25, 4096}) {
    const Outcome outcome = import_raw_bytes(std::string(size, 'a'), small_description());
    EXPECT_EQ(outcome.code, ErrorCode::kInvalidParameter);
    EXPECT_THAT(outcome.error, HasSubstr("take 24 bytes"));
    EXPECT_THAT(outcome.error, HasSubstr("has " + std::to_string(size)));
  }
}

TEST(Raw, IsRefusedForDimsAndGeometryThatCannotBe) {
  RawDescription description = small_description();
  description.dims[1] = 0;
  EXPECT_EQ(import_raw_bytes("", description).code, ErrorCode::kInvalidParameter);
  description.dims = {4294967295U, 4294967295U, 4294967295U};
  EXPECT_EQ(import_raw_bytes("", description).code, ErrorCode::kInvalidParameter);
  description = small_description();
  description.geometry.spacing[2] = std::nan("");
  const Outcome outcome = import_raw_bytes(kSmallSamples, description);
  EXPECT_EQ(outcome.code, ErrorCode::kInvalidParameter);
  EXPECT_THAT(outcome.error, HasSubstr("spacing"));
}

TEST(Raw, IsRefusedBeyondTheLimits) {
  EXPECT_EQ(import_raw_bytes(kSmallSamples, small_description(), {.max_sample_bytes = 23}).code,
            ErrorCode::kTooLarge);
  EXPECT_TRUE(
      import_raw_bytes(kSmallSamples, small_description(), {.max_sample_bytes = 24}).imported());
}

TEST(Raw, KeepsItsGeometry) {
  RawDescription description = small_description();
  description.geometry = {
      .origin = {1, -2, 3}, .spacing = {0.5, 2, 3}, .direction = {0, 0, 1, 1, 0, 0, 0, -1, 0}};
  const Outcome outcome = import_raw_bytes(kSmallSamples, description);
  EXPECT_EQ(outcome.volume.geometry, description.geometry);
  EXPECT_EQ(outcome.sample_bytes(), kSmallSamples);
}

}  // namespace
}  // namespace isomesh::import::test
