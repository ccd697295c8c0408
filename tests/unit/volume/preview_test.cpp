#include "server/volume/preview.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/errors.h"
#include "tests/support/files.h"
#include "tests/unit/volume/stored.h"

namespace isomesh::volume::test {
namespace {

using isomesh::test::TemporaryFolder;
using testing::ElementsAre;
using testing::HasSubstr;

struct File {
  std::string header;
  std::vector<int> samples;
};

class PreviewTest : public testing::Test {
 protected:
  template <class Sample>
  std::shared_ptr<const CanonicalFile> volume_of(const CanonicalHeader& header,
                                                 const std::vector<Sample>& samples) {
    return stored(folder_, header, samples);
  }

  static CanonicalHeader header_of(const std::array<std::uint32_t, 3>& dims, SampleType type) {
    CanonicalHeader header;
    header.dims = dims;
    header.type = type;
    return header;
  }

  static File file_of(const std::shared_ptr<const CanonicalFile>& volume,
                      const PreviewChoice& choice) {
    PreviewNrrd preview(volume, choice);
    std::string bytes;
    for (auto more = preview.next(); more; more = preview.next()) bytes += *more;
    EXPECT_EQ(bytes.size(), preview.size());
    const std::size_t end = bytes.find("\n\n") + 2;
    File file = {bytes.substr(0, end), {}};
    for (const char c : bytes.substr(end)) file.samples.push_back(static_cast<unsigned char>(c));
    return file;
  }

  const TemporaryFolder folder_;
};

TEST_F(PreviewTest, ASmallVolumeStaysAsItIs) {
  const auto volume = volume_of<std::uint8_t>(header_of({3, 2, 2}, SampleType::kUint8),
                                              {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 255});
  const File file = file_of(volume, {3, {0, 255}});
  EXPECT_THAT(file.samples, ElementsAre(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 255));
  EXPECT_EQ(file.header,
            "NRRD0004\ntype: uint8\ndimension: 3\nspace: left-posterior-superior\nsizes: 3 2 2\n"
            "space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\nencoding: raw\n\n");
}

// The last of the five samples along x is alone in its block.
TEST_F(PreviewTest, BlocksBecomeTheirMeans) {
  CanonicalHeader header = header_of({5, 2, 3}, SampleType::kInt16);
  header.geometry.spacing = {0.5, 2, 1};
  header.geometry.origin = {10, 20, 30};
  header.geometry.direction = {-1, 0, 0, 0, 0, -1, 0, 1, 0};
  std::vector<std::int16_t> samples(30);
  for (std::size_t at = 0; at < samples.size(); ++at) {
    samples[at] = static_cast<std::int16_t>(10 * (at % 5) - 100);
  }
  const File file = file_of(volume_of(header, samples), {3, {-100, 155}});
  // The axes y and z have no more than three samples, and stay.
  EXPECT_THAT(file.samples,
              ElementsAre(5, 25, 40, 5, 25, 40, 5, 25, 40, 5, 25, 40, 5, 25, 40, 5, 25, 40));
  EXPECT_THAT(file.header, HasSubstr("\nsizes: 3 2 3\n"));
  EXPECT_THAT(file.header, HasSubstr("\nspace directions: (-1,0,0) (0,0,2) (0,-1,0)\n"));
  EXPECT_THAT(file.header, HasSubstr("\nspace origin: (9.75,20,30)\n"));
}

TEST_F(PreviewTest, LayersAreMeansOfSlices) {
  std::vector<float> samples;
  for (const float slice : {0.F, 10.F, 20.F, 30.F, 50.F}) samples.insert(samples.end(), 4, slice);
  const auto volume = volume_of(header_of({2, 2, 5}, SampleType::kFloat32), samples);
  EXPECT_THAT(file_of(volume, {2, {0, 255}}).samples, ElementsAre(10, 10, 10, 10, 40, 40, 40, 40));
  EXPECT_THAT(file_of(volume, {1, {0, 220}}).samples, ElementsAre(testing::Eq(26)));  // 22 of 220
}

TEST_F(PreviewTest, WhatIsNoNumberCountsForNothing) {
  const float none = std::numeric_limits<float>::quiet_NaN();
  const auto volume =
      volume_of<float>(header_of({4, 1, 1}, SampleType::kFloat32), {none, 100, none, none});
  EXPECT_THAT(file_of(volume, {2, {0, 255}}).samples, ElementsAre(100, 0));
}

TEST_F(PreviewTest, ManySamplesComeInPieces) {
  const auto volume = volume_of(header_of({1500, 1000, 3}, SampleType::kUint8),
                                std::vector<std::uint8_t>(1500 * 1000 * 3, 7));
  PreviewNrrd preview(volume, {256, {0, 255}});
  std::size_t pieces = 0;
  std::string bytes;
  for (auto more = preview.next(); more; more = preview.next()) {
    ++pieces;
    bytes += *more;
  }
  EXPECT_GE(pieces, 4U);
  EXPECT_EQ(bytes.size(), preview.size());
  EXPECT_EQ(bytes.substr(bytes.find("\n\n") + 2), std::string(250 * 250 * 3, 7));
}

// A head holder is a sheet of about two samples. Means of its blocks cross the iso-value where it
// lies within one block, and do not where two share it.
std::vector<float> tilted_sheet(std::uint32_t size, float inside, float outside) {
  std::vector<float> samples;
  for (std::uint32_t z = 0; z < size; ++z) {
    for (std::uint32_t y = 0; y < size; ++y) {
      for (std::uint32_t x = 0; x < size; ++x) {
        const double from = std::abs(y + 0.12 * x + 0.21 * z - 30);
        const auto part = static_cast<float>(std::clamp(1.5 - from, 0.0, 1.0));
        samples.push_back(outside + part * (inside - outside));
      }
    }
  }
  return samples;
}

TEST_F(PreviewTest, AThinSheetHasNoHoles) {
  constexpr std::uint32_t kSize = 48;
  for (const std::uint32_t block : {2U, 4U}) {
    const std::uint32_t count = kSize / block;
    for (const bool is_bright : {true, false}) {
      const auto samples =
          is_bright ? tilted_sheet(kSize, 100, -1000) : tilted_sheet(kSize, -1000, 100);
      const File file =
          file_of(volume_of(header_of({kSize, kSize, kSize}, SampleType::kFloat32), samples),
                  {count, {-1000, 100}});
      // Every line across it meets it.
      for (std::uint32_t at = 0; at < count * count; ++at) {
        int most = 0;
        for (std::uint32_t y = 0; y < count; ++y) {
          const int value = file.samples[(at / count * count + y) * count + at % count];
          most = std::max(most, is_bright ? value : 255 - value);
        }
        ASSERT_GT(most, 180) << block << ' ' << is_bright << ' ' << at;
      }
    }
  }
}

TEST_F(PreviewTest, WhatIsThickStaysAMean) {
  constexpr std::uint32_t kSize = 48;
  std::vector<float> samples;
  double sum = 0;
  for (std::uint32_t at = 0; at < kSize * kSize * kSize; ++at) {
    const double x = at % kSize - 23.0;
    const double y = at / kSize % kSize - 23.0;
    const double z = at / kSize / kSize - 24.0;
    samples.push_back(static_cast<float>(std::clamp(15.5 - std::hypot(x, y, z), 0.0, 1.0)));
    sum += samples.back();
  }
  for (const std::uint32_t block : {2U, 3U}) {
    const File file =
        file_of(volume_of(header_of({kSize, kSize, kSize}, SampleType::kFloat32), samples),
                {kSize / block, {0, 1}});
    const double reduced = std::accumulate(file.samples.begin(), file.samples.end(), 0.0);
    EXPECT_NEAR(reduced / 255 * std::pow(block, 3) / sum, 1, 0.002);
  }
}

// A signal would end everybody else's requests too.
TEST_F(PreviewTest, AFileThatIsCutMeanwhileIsAnError) {
  PreviewNrrd preview(volume_of(header_of({300, 200, 3}, SampleType::kUint8),
                                std::vector<std::uint8_t>(300 * 200 * 3, 7)),
                      {64, {0, 9}});
  std::filesystem::resize_file(folder_ / "volume", kHeaderBytes + 300);
  const auto error = isomesh::test::thrown_by([&] {
    while (preview.next()) continue;
  });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code(), ErrorCode::kUnusableVolume);
}

}  // namespace
}  // namespace isomesh::volume::test
