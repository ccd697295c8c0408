// Segmentations of single bits, and label maps.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/import/dicom/tags.h"
#include "tests/unit/import/dicom/segments.h"

namespace isomesh::import::test {
namespace {

using namespace dicom;
using testing::HasSubstr;

Outcome import_labels(const SegmentObject& object, const ImportOptions& options = {},
                      std::string_view syntax = kExplicit) {
  return import_objects({{"seg", segmentation(object).file(syntax)}}, options);
}

unsigned label_at(const Outcome& outcome, unsigned place, unsigned plane) {
  return samples_of<std::uint8_t>(outcome).at(plane * kSegmentSamples + place);
}

TEST(DicomSegmentation, OfSeveralSegmentsIsOneLabelMap) {
  for (const std::string_view syntax : {kImplicit, kExplicit, kDeflate, kBigEndian}) {
    const Outcome outcome = import_labels(two_segments(), {}, syntax);
    ASSERT_EQ(outcome.error, "") << syntax;
    EXPECT_EQ(outcome.volume.type, SampleType::kUint8);
    EXPECT_EQ(outcome.volume.dims,
              (std::array<std::uint32_t, 3>{kSegmentColumns, kSegmentRows, 3}));
    EXPECT_EQ(outcome.volume.geometry.spacing, (std::array<double, 3>{0.75, 0.5, 2}));
    std::vector<std::uint8_t> expected(kSegmentSamples * 3);
    expected[0] = expected[7] = 1;
    expected[kSegmentSamples + 14] = 1;
    expected[kSegmentSamples + 3] = 2;
    expected[2 * kSegmentSamples + 1] = 2;
    EXPECT_EQ(samples_of<std::uint8_t>(outcome), expected) << syntax;
  }
}

TEST(DicomSegmentation, WithHighNumbersHasWiderLabels) {
  SegmentObject object = two_segments();
  object.frames[2].segment = 300;
  object.frames[3].segment = 300;
  const Outcome outcome = import_labels(object);
  ASSERT_EQ(outcome.error, "");
  EXPECT_EQ(samples_of<std::uint16_t>(outcome)[kSegmentSamples + 3], 300);
}

TEST(DicomSegmentation, WithOverlapsOffersItsSegments) {
  SegmentObject object = two_segments();
  object.frames[2].labels = {14};
  const Outcome outcome = import_labels(object);
  EXPECT_EQ(outcome.code, ErrorCode::kUnusableVolume);
  EXPECT_THAT(outcome.error, HasSubstr("overlap, 1 (\"liver\") and 2 (\"spleen\")"));
  EXPECT_THAT(outcome.error, HasSubstr("one of its 2 segments"));
  EXPECT_THAT(outcome.remedy.choices,
              testing::ElementsAre(Choice{"volume", "0", "1 (\"liver\")"},
                                   Choice{"volume", "1", "2 (\"spleen\")"}));
  const Outcome chosen = import_labels(object, {.volume = 1});
  ASSERT_EQ(chosen.error, "");
  EXPECT_EQ(chosen.volume.dims[2], 2);
  EXPECT_EQ(label_at(chosen, 14, 0), 2);
  EXPECT_EQ(label_at(chosen, 1, 1), 2);
  EXPECT_EQ(chosen.volume.geometry.origin[2], 2);
  EXPECT_THAT(import_labels(object, {.volume = 2}).error, HasSubstr("none of them is volume 2"));
}

TEST(DicomSegmentation, HasEmptyPlanesWhereFramesAreLeftOut) {
  SegmentObject object = two_segments();
  object.slice_distance = "1.0";
  const Outcome told = import_labels(object);
  ASSERT_EQ(told.error, "");
  EXPECT_EQ(told.volume.dims[2], 5);
  EXPECT_EQ(told.volume.geometry.spacing[2], 1);
  EXPECT_THAT(note_detail(told, NoteCode::kEmptyPlanes), HasSubstr("2 of the 5 planes"));
  EXPECT_EQ(label_at(told, 14, 2), 1);
  for (unsigned place = 0; place < kSegmentSamples; ++place) {
    EXPECT_EQ(label_at(told, place, 1) + label_at(told, place, 3), 0);
  }
  // What is told of the distance holds where positions agree with it, and these do not.
  object.slice_distance = "1.5";
  EXPECT_EQ(import_labels(object).volume.dims[2], 3);
  // Without it the smallest gap is the distance.
  object.slice_distance = "";
  object.frames[3].z = 12;
  const Outcome sparse = import_labels(object);
  ASSERT_EQ(sparse.error, "");
  EXPECT_EQ(sparse.volume.dims[2], 7);
  EXPECT_EQ(label_at(sparse, 1, 6), 2);
}

TEST(DicomSegmentation, OfUnevenFramesIsRefused) {
  SegmentObject object = two_segments();
  object.frames[3].z = 5;
  EXPECT_THAT(import_labels(object).error, HasSubstr("unevenly spaced"));
  object.frames = {{.z = 3, .segment = 1, .labels = {1}}, {.z = 3, .segment = 2, .labels = {2}}};
  EXPECT_THAT(import_labels(object).error, HasSubstr("single slice"));
  object.frames = {{.z = 3, .segment = 1, .labels = {1}},
                   {.z = 3, .segment = 1, .labels = {2}},
                   {.z = 4, .segment = 1, .labels = {2}}};
  EXPECT_THAT(import_labels(object).error, HasSubstr("two frames of segment 1"));
  object.frames = {{.z = 0, .segment = 1, .labels = {}},
                   {.z = 1e-2, .segment = 1, .labels = {}},
                   {.z = 1e4, .segment = 1, .labels = {}}};
  EXPECT_THAT(import_labels(object).error, HasSubstr("more than 65535 planes apart"));
}

TEST(DicomSegmentation, TellsTheSegmentOfEachFrame) {
  SegmentObject object = two_segments();
  object.frames[2].segment = 0;
  EXPECT_THAT(import_labels(object).error, HasSubstr("which segment its frame 3 shows"));
}

TEST(DicomSegmentation, IsRefusedWhenItIsFractional) {
  SegmentObject object = two_segments();
  object.type = "FRACTIONAL";
  EXPECT_THAT(import_labels(object).error, HasSubstr("\"FRACTIONAL\""));
}

TEST(DicomSegmentation, OfLabelsKeepsThem) {
  const SegmentObject object = {.frames = {{.z = 0, .labels = {2}}, {.z = 5, .labels = {3}}},
                                .type = "LABELMAP",
                                .slice_distance = "2.5"};
  const Outcome outcome = import_labels(object);
  ASSERT_EQ(outcome.error, "");
  EXPECT_EQ(outcome.volume.dims[2], 3);
  EXPECT_EQ(outcome.volume.geometry.spacing[2], 2.5);
  EXPECT_EQ(label_at(outcome, 2, 0), 7);
  EXPECT_EQ(label_at(outcome, 3, 2), 7);
  EXPECT_EQ(outcome.volume.range, (std::array<double, 2>{0, 7}));
  // Colours for the labels do not change them.
  const Outcome coloured = import_objects(
      {{"seg",
        segmentation(object).text(kPhotometricInterpretation, "CS", "PALETTE COLOR").file()}});
  EXPECT_EQ(coloured.canonical, outcome.canonical);
}

// Frames are left out of segmentations and nowhere else.
TEST(DicomSegmentation, AloneMayHaveMissingFrames) {
  const SegmentObject object = {.frames = {{.z = 0, .labels = {2}},
                                           {.z = 2, .labels = {3}},
                                           {.z = 4, .labels = {3}},
                                           {.z = 8, .labels = {3}}},
                                .type = "LABELMAP"};
  EXPECT_EQ(import_labels(object).volume.dims[2], 5);
  const DicomObject image =
      segmentation(object).erase(kSegmentationType).text(kModality, "CS", "CT");
  EXPECT_THAT(import_objects({{"image", image.file()}}).error, HasSubstr("missing"));
}

TEST(DicomSegmentation, IsAVolumeOfItsSeries) {
  const NamedFiles files = {{"one", segmentation(two_segments()).file()},
                            {"two", segmentation(two_segments())
                                        .text(kSopInstanceUid, "UI", "1.2.3.9")
                                        .text(kInstanceNumber, "IS", "2")
                                        .file()}};
  const Outcome outcome = import_objects(files);
  EXPECT_THAT(outcome.error, HasSubstr("2 volumes"));
  EXPECT_EQ(outcome.remedy.choices.at(1).title, "\"two\", 2 segments");
  EXPECT_EQ(import_objects(files, {.volume = 1}).volume.dims[2], 3);
}

}  // namespace
}  // namespace isomesh::import::test
