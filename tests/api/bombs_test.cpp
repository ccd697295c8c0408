// Small uploads that tell or unpack to what no machine has room for. Each is read by a process with
// little memory and time, and is to be refused for what it is before it has taken either.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/json.h"
#include "server/import/dicom/elements/tags.h"
#include "tests/api/daemon.h"
#include "tests/api/problems.h"
#include "tests/support/deflate.h"
#include "tests/unit/import/archives.h"
#include "tests/unit/import/dicom/objects.h"

namespace isomesh::test {
namespace {

using testing::AnyOf;
using testing::HasSubstr;

std::string big_endian(std::uint32_t value, std::size_t bytes) {
  std::string text;
  for (std::size_t at = bytes; at-- > 0;) text += static_cast<char>(value >> (8 * at) & 0xFFU);
  return text;
}

// A JPEG 2000 stream (ISO/IEC 15444-1, annex A) of one empty tile of that size: 16 bits, no wavelet
// levels, reversible. Its packets say that no block has any bytes, which means samples of one
// value.
std::string blank_jpeg_2000(std::uint32_t size) {
  const auto four = [](std::uint32_t value) { return big_endian(value, 4); };
  const auto two = [](std::uint32_t value) { return big_endian(value, 2); };
  const std::string image = four(size) + four(size) + four(0) + four(0);
  const std::string packets(16, '\0');
  return two(0xFF4F) + two(0xFF51) + two(41) + two(0) + image + image + two(1) +
         std::string("\x0F\1\1") + two(0xFF52) + two(12) + std::string("\0\0\0\1\0", 5) +
         std::string("\0\4\4\0\1", 5) + two(0xFF5C) + two(4) + std::string("\x40\x80") +
         two(0xFF90) + two(10) + two(0) + four(static_cast<std::uint32_t>(14 + packets.size())) +
         std::string("\0\1", 2) + two(0xFF93) + packets + two(0xFFD9);
}

// A slice of a CT in JPEG 2000 whose every header tells that size.
std::string blank_slice(std::uint16_t size, std::uint32_t number) {
  std::string stream = blank_jpeg_2000(size);
  stream.resize((stream.size() + 1) / 2 * 2);
  return import::test::DicomSeries{.bits_stored = 16, .high_bit = 15}
      .slice(number)
      .number(import::dicom::kRows, size)
      .number(import::dicom::kColumns, size)
      .fragments({stream}, {})
      .file("1.2.840.10008.1.2.4.90");
}

std::string blank_series(std::uint16_t size) {
  return import::test::zip({{"1.dcm", blank_slice(size, 1)}, {"2.dcm", blank_slice(size, 2)}});
}

class BombsTest : public testing::Test {
 protected:
  Problem refusal_of(const std::string& bomb) { return refusal_by(daemon_, bomb); }

  static Problem refusal_by(const Daemon& daemon, const std::string& bomb) {
    const Answer answer = daemon.send("POST", "/v1/volumes", bomb);
    EXPECT_TRUE(is_problem(answer, ErrorCode::kUnusableVolume)) << answer.body;
    return problem_from_json(answer.body);
  }

  const Daemon daemon_{{"--import-memory", "256MiB", "--import-seconds", "30"}};
};

// So that the others are not refused for how they are written.
TEST_F(BombsTest, ASmallBlankSeriesIsAVolume) {
  const Answer answer = daemon_.send("POST", "/v1/volumes", blank_series(64));
  ASSERT_EQ(answer.status, 201) << answer.body;
  EXPECT_EQ(volume_from_json(answer.body).dims, (std::array<std::uint32_t, 3>{64, 64, 2}));
}

TEST_F(BombsTest, JpegsThatTellBillionsOfSamplesAreRefused) {
  const auto refused = [](const Daemon& daemon, std::uint16_t size, const auto& matcher) {
    const std::string bomb = blank_series(size);
    ASSERT_LT(bomb.size(), 10'000U);
    EXPECT_THAT(refusal_by(daemon, bomb).detail, matcher);
  };
  refused(daemon_, 60000, HasSubstr("more than can be decoded"));
  // Decoding needs more memory than an import may use. Under a sanitizer memory is not limited;
  // there it exceeds the time limit.
  const Daemon brief{{"--import-memory", "256MiB", "--import-seconds", "5"}};
  refused(brief, 16000,
          AnyOf(HasSubstr("memory"), HasSubstr("corrupt"), HasSubstr("The import took too long")));
}

TEST_F(BombsTest, WhatUnpacksToMoreThanItsHeaderTellsIsRefused) {
  const std::string zeros(std::size_t{100} << 20, '\0');
  const std::string header = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 4 3 2\nencoding: raw\n\n";
  EXPECT_THAT(refusal_of(import::test::zip({{"a.nrrd", header + zeros}})).detail,
              HasSubstr("that its header allows"));
  EXPECT_THAT(refusal_of(gzip(header + zeros)).detail, HasSubstr("unpacks to more than"));
}

}  // namespace
}  // namespace isomesh::test
