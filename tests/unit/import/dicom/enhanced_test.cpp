// Objects of several frames: Enhanced CT and MR, and others.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/import/dicom/elements/tags.h"
#include "tests/unit/import/dicom/objects.h"

namespace isomesh::import::test {
namespace {

using namespace dicom;
using testing::AllOf;
using testing::HasSubstr;

const std::vector<std::uint32_t> kShuffled = {4, 0, 5, 2, 1, 3};

TEST(DicomFrames, AreSortedLikeSlices) {
  const DicomSeries series;
  const Outcome slices = import_objects(series.files());
  for (const std::string_view syntax : {kImplicit, kExplicit, kDeflate, kBigEndian}) {
    const Outcome frames = import_objects({{"one", series.enhanced(kShuffled).file(syntax)}});
    EXPECT_EQ(frames.error, "") << syntax;
    EXPECT_EQ(frames.canonical, slices.canonical) << syntax;
    ASSERT_EQ(frames.volume.dicom->instances.size(), 1);
  }
}

TEST(DicomFrames, OfSeveralFilesMakeOneVolume) {
  const DicomSeries series;
  const Outcome outcome = imported(import_objects(
      {{"b", series.enhanced({5, 1, 3}).file()}, {"a", series.enhanced({0, 4, 2}).file()}}));
  EXPECT_EQ(outcome.canonical, import_objects(series.files()).canonical);
}

TEST(DicomFrames, HaveTheirOwnScales) {
  const DicomSeries series;
  std::vector<DicomObject> frames;
  for (std::uint32_t k = 0; k < series.slices; ++k) {
    DicomObject scale;
    scale.text(kRescaleSlope, "DS", std::to_string(k + 1)).text(kRescaleIntercept, "DS", "-7");
    frames.push_back(
        frame_at(series.position(k)).items(kPixelValueTransformationSequence, {scale}));
  }
  DicomObject object = series.enhanced({0, 1, 2, 3, 4, 5});
  object.items(kPerFrameFunctionalGroups, frames);
  const Outcome outcome = imported(import_objects({{"one", object.file()}}));
  ASSERT_EQ(outcome.volume.type, SampleType::kInt16);
  const auto samples = samples_of<std::int16_t>(outcome);
  for (std::uint32_t k = 0; k < 6; ++k) {
    EXPECT_EQ(samples[k * 20 + 7], series.stored(2, 1, k) * (k + 1) - 7) << k;
  }
}

// Frames with the positions of `order` and the samples of other slices.
DicomObject mixed_frames(const DicomSeries& series, const std::vector<std::uint32_t>& order) {
  std::string pixels;
  for (std::uint32_t frame = 0; frame < order.size(); ++frame) pixels += series.native_bytes(frame);
  return series.enhanced(order).pixels(pixels, 2);
}

TEST(DicomFrames, ThatAreMissingOrDoubledAreNamed) {
  const DicomSeries series;
  const auto error_of = [&](const std::vector<std::uint32_t>& order) {
    return import_objects({{"one", series.enhanced(order).file()}}).error;
  };
  EXPECT_THAT(error_of({0, 1, 2, 4, 5}), HasSubstr("slice 4 of 6 is missing"));
  EXPECT_THAT(error_of({5, 4, 2, 1, 0}), HasSubstr("slice 3 of 6 is missing"));
  EXPECT_THAT(import_objects({{"one", mixed_frames(series, {0, 1, 2, 3, 4, 5, 4}).file()}}).error,
              AllOf(HasSubstr("frame 5 and frame 7 lie at one position"),
                    HasSubstr("accept=duplicate-slice to use frame 5")));
  EXPECT_THAT(import_objects({{"one", mixed_frames(series, {0, 1, 0, 2, 1, 2}).file()}}).error,
              HasSubstr("2 slices at each of its 3 positions"));
  EXPECT_THAT(error_of({3}), HasSubstr("1 slice of"));
}

TEST(DicomFrames, MustAllBeDescribed) {
  const DicomSeries series;
  DicomObject object = series.enhanced({0, 1, 2, 3, 4, 5});
  object.text(kNumberOfFrames, "IS", "5");
  EXPECT_THAT(import_objects({{"one", object.file()}}).error,
              HasSubstr("5 frames, but describes 6"));
}

}  // namespace
}  // namespace isomesh::import::test
