#include "server/volume/slice.h"

#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/errors.h"
#include "tests/support/files.h"
#include "tests/support/png.h"
#include "tests/unit/volume/stored.h"

namespace isomesh::volume::test {
namespace {

using isomesh::test::GreyPicture;
using isomesh::test::TemporaryFolder;
using testing::ElementsAre;

class SliceTest : public testing::Test {
 protected:
  template <class Sample>
  std::shared_ptr<const CanonicalFile> volume_of(const CanonicalHeader& header,
                                                 const std::vector<Sample>& samples) {
    return stored(folder_, header, samples);
  }

  // The sample (i,j,k) is 100 k + 10 j + i.
  std::shared_ptr<const CanonicalFile> numbered() {
    CanonicalHeader header;
    header.dims = {4, 3, 2};
    header.type = SampleType::kUint8;
    header.geometry.spacing = {0.5, 2, 4};
    std::vector<std::uint8_t> samples;
    for (int k = 0; k < 2; ++k) {
      for (int j = 0; j < 3; ++j) {
        for (int i = 0; i < 4; ++i)
          samples.push_back(static_cast<std::uint8_t>(100 * k + 10 * j + i));
      }
    }
    return volume_of(header, samples);
  }

  static GreyPicture picture(const std::shared_ptr<const CanonicalFile>& volume,
                             const SliceChoice& choice) {
    SlicePng png(volume, choice);
    std::string bytes;
    for (auto more = png.next(); more; more = png.next()) bytes += *more;
    EXPECT_FALSE(png.next());
    return isomesh::test::read_png(bytes);
  }

  const TemporaryFolder folder_;
};

// A signal would end everybody else's requests too.
TEST_F(SliceTest, AFileThatIsCutMeanwhileIsAnError) {
  CanonicalHeader header;
  header.dims = {300, 200, 3};
  header.type = SampleType::kUint8;
  for (const Axis axis : {Axis::kX, Axis::kY, Axis::kZ}) {
    SlicePng png(volume_of(header, std::vector<std::uint8_t>(300 * 200 * 3, 7)), {axis, 1, {0, 9}});
    std::filesystem::resize_file(folder_ / "volume", kHeaderBytes + 300);
    const auto error = isomesh::test::thrown_by([&] {
      while (png.next()) continue;
    });
    ASSERT_TRUE(error);
    EXPECT_EQ(error->code(), ErrorCode::kUnusableVolume);
  }
}

// Rows along x, y and z, of samples that lie close together and far apart.
TEST_F(SliceTest, ReadsRowsOfAnyStride) {
  CanonicalHeader header;
  header.dims = {2500, 3, 5};
  header.type = SampleType::kUint16;
  std::vector<std::uint16_t> samples(2500 * 3 * 5);
  for (std::size_t n = 0; n < samples.size(); ++n) {
    samples[n] = static_cast<std::uint16_t>(n % 251);
  }
  const auto volume = volume_of(header, samples);
  const auto at = [&](std::size_t i, std::size_t j, std::size_t k) {
    return static_cast<std::uint8_t>(samples[i + 2500 * (j + 3 * k)]);
  };
  const GreyPicture x = picture(volume, {Axis::kX, 2003, {0, 255}});
  const GreyPicture y = picture(volume, {Axis::kY, 1, {0, 255}});
  const GreyPicture z = picture(volume, {Axis::kZ, 4, {0, 255}});
  for (std::size_t j = 0; j < 3; ++j) {
    for (std::size_t k = 0; k < 5; ++k) EXPECT_EQ(x.pixels[k * 3 + j], at(2003, j, k));
  }
  for (std::size_t i = 0; i < 2500; ++i) {
    for (std::size_t k = 0; k < 5; ++k) ASSERT_EQ(y.pixels[k * 2500 + i], at(i, 1, k));
    for (std::size_t j = 0; j < 3; ++j) ASSERT_EQ(z.pixels[j * 2500 + i], at(i, j, 4));
  }
}

TEST_F(SliceTest, HasTheSamplesOfEachAxisInTheirOrder) {
  const auto volume = numbered();
  const GreyPicture z = picture(volume, {Axis::kZ, 1, {0, 255}});
  EXPECT_EQ(z.width, 4U);
  EXPECT_EQ(z.height, 3U);
  EXPECT_THAT(z.pixels, ElementsAre(100, 101, 102, 103, 110, 111, 112, 113, 120, 121, 122, 123));
  const GreyPicture y = picture(volume, {Axis::kY, 2, {0, 255}});
  EXPECT_EQ(y.width, 4U);
  EXPECT_EQ(y.height, 2U);
  EXPECT_THAT(y.pixels, ElementsAre(20, 21, 22, 23, 120, 121, 122, 123));
  const GreyPicture x = picture(volume, {Axis::kX, 3, {0, 255}});
  EXPECT_EQ(x.width, 3U);
  EXPECT_EQ(x.height, 2U);
  EXPECT_THAT(x.pixels, ElementsAre(3, 13, 23, 103, 113, 123));
}

TEST_F(SliceTest, SaysHowLargeItsPixelsAre) {
  const GreyPicture z = picture(numbered(), {Axis::kZ, 0, {0, 255}});
  EXPECT_EQ(z.across, 2000U);
  EXPECT_EQ(z.down, 500U);
  const GreyPicture x = picture(numbered(), {Axis::kX, 0, {0, 255}});
  EXPECT_EQ(x.across, 500U);
  EXPECT_EQ(x.down, 250U);
}

TEST_F(SliceTest, TheWindowIsLinearBetweenBlackAndWhite) {
  CanonicalHeader header;
  header.dims = {8, 1, 1};
  header.type = SampleType::kFloat32;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinite = std::numeric_limits<float>::infinity();
  const auto volume =
      volume_of(header, std::vector<float>{-500, -160, -159, 40, 239, 240, nan, infinite});
  EXPECT_THAT(picture(volume, {Axis::kZ, 0, {-160, 240}}).pixels,
              ElementsAre(0, 0, 1, 128, 254, 255, 0, 255));
}

TEST_F(SliceTest, TheWindowMayBeAsNarrowOrWideAsNumbersAre) {
  CanonicalHeader header;
  header.dims = {3, 1, 1};
  header.type = SampleType::kFloat64;
  constexpr double kLeast = std::numeric_limits<double>::denorm_min();
  const auto narrow = volume_of(header, std::vector<double>{3 * kLeast, 4 * kLeast, 5 * kLeast});
  EXPECT_THAT(picture(narrow, {Axis::kZ, 0, {3 * kLeast, 5 * kLeast}}).pixels,
              ElementsAre(0, 128, 255));
  constexpr double kMost = std::numeric_limits<double>::max();
  const auto wide = volume_of(header, std::vector<double>{-kMost, 0, kMost});
  EXPECT_THAT(picture(wide, {Axis::kZ, 0, {-kMost, kMost}}).pixels, ElementsAre(0, 128, 255));
}

TEST_F(SliceTest, AConstantVolumeIsBlackInItsRange) {
  CanonicalHeader header;
  header.dims = {2, 2, 1};
  header.type = SampleType::kInt16;
  const auto volume = volume_of(header, std::vector<std::int16_t>(4, -7));
  EXPECT_THAT(picture(volume, {Axis::kZ, 0, {-7, -7}}).pixels, ElementsAre(0, 0, 0, 0));
}

TEST_F(SliceTest, ComesInPiecesThatAreBounded) {
  CanonicalHeader header;
  header.dims = {3000, 400, 1};
  header.type = SampleType::kUint16;
  std::vector<std::uint16_t> noise(1'200'000);
  std::uint32_t state = 1;
  for (std::uint16_t& sample : noise) {
    state = state * 1664525 + 1013904223;
    sample = static_cast<std::uint16_t>(state >> 16);
  }
  SlicePng png(volume_of(header, noise), {Axis::kZ, 0, {0, 65535}});
  std::size_t pieces = 0;
  std::string bytes;
  for (auto more = png.next(); more; more = png.next()) {
    EXPECT_LT(more->size(), 200'000U);
    bytes += *more;
    ++pieces;
  }
  EXPECT_GT(pieces, 3U);
  const GreyPicture whole = isomesh::test::read_png(bytes);
  EXPECT_EQ(whole.width, 3000U);
  EXPECT_EQ(whole.height, 400U);
}

// One piece of a blank picture's file would be made of hundreds of millions of samples.
TEST_F(SliceTest, APieceIsOfSoManySamplesHoweverFewBytesTheyMake) {
  CanonicalHeader header;
  header.dims = {4000, 2000, 1};
  header.type = SampleType::kUint8;
  SlicePng png(volume_of(header, std::vector<std::uint8_t>(8'000'000)), {Axis::kZ, 0, {0, 1}});
  std::size_t pieces = 0;
  std::string bytes;
  for (auto more = png.next(); more; more = png.next(), ++pieces) bytes += *more;
  EXPECT_GE(pieces, 8'000'000 / SlicePng::kSamplesPerPiece);
  EXPECT_EQ(isomesh::test::read_png(bytes).height, 2000U);
}

}  // namespace
}  // namespace isomesh::volume::test
