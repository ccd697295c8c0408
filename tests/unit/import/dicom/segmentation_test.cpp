// Segmentations of single bits, and label maps.
#include <algorithm>
#include <cmath>
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/import/dicom/elements/tags.h"
#include "tests/support/deflate.h"
#include "tests/unit/import/dicom/segments.h"

namespace isomesh::import::test {
namespace {

using namespace dicom;
using testing::HasSubstr;

// The planes from the first frame's to the last one's, without those that close the ends.
Outcome described(Outcome outcome, SegmentObject object, const ImportOptions& options = {}) {
  if (!outcome.imported()) return outcome;
  if (options.volume) {
    std::erase_if(object.frames,
                  [&](const SegmentFrame& frame) { return frame.segment != *options.volume + 1; });
  }
  const auto [first, last] = std::ranges::minmax(object.frames, {}, &SegmentFrame::z);
  const double planes = (last.z - first.z) / outcome.volume.geometry.spacing[2];
  return without_ends(
      std::move(outcome), {0, 0, first.z},
      {kSegmentColumns, kSegmentRows, static_cast<std::uint32_t>(std::lround(planes)) + 1});
}

Outcome import_labels(const SegmentObject& object, const ImportOptions& options = {},
                      std::string_view syntax = kExplicit) {
  return described(import_objects({{"seg", segmentation(object).file(syntax)}}, options), object,
                   options);
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
  const Outcome outcome = imported(import_labels(object));
  EXPECT_EQ(samples_of<std::uint16_t>(outcome)[kSegmentSamples + 3], 300);
}

LabelEntry entry(std::int64_t label, const std::string& name,
                 std::vector<std::int64_t> values = {}) {
  return {.label = label, .name = name, .color = {}, .values = std::move(values)};
}

TEST(DicomSegmentation, HasTextsInTheCharacterSetOfTheObject) {
  const DicomObject code = DicomObject().text(kCodeMeaning, "LO", "K\xc3\xb6rper");
  DicomObject own;
  own.text(kSpecificCharacterSet, "CS", "ISO_IR 100")
      .number(kSegmentNumber, 2)
      .text(kSegmentLabel, "LO", "Dr\xfcse")
      .items(kSegmentedPropertyTypeCodeSequence,
             {DicomObject().text(kCodeMeaning, "LO", "Gef\xe4\xdf")});
  DicomObject inherited;
  inherited.number(kSegmentNumber, 1)
      .text(kSegmentLabel, "LO",
            "Gro\xc3\x9f"
            "e")
      .items(kSegmentedPropertyTypeCodeSequence, {code});
  DicomObject object = segmentation(two_segments());
  object.text(kSpecificCharacterSet, "CS", "ISO_IR 192").items(kSegmentSequence, {own, inherited});
  for (const std::string_view syntax : {kImplicit, kExplicit, kDeflate, kBigEndian}) {
    const Outcome outcome = import_objects({{"seg", object.file(syntax)}});
    ASSERT_EQ(outcome.error, "") << syntax;
    EXPECT_THAT(outcome.volume.labels, testing::ElementsAre(entry(1, "Große"), entry(2, "Drüse")));
    const auto& segments = outcome.volume.dicom->segments;
    ASSERT_EQ(segments.size(), 2) << syntax;
    EXPECT_EQ(segments[0].type.meaning, "Körper");
    EXPECT_EQ(segments[1].type.meaning, "Gefäß");
  }
}

TEST(DicomSegmentation, NamesItsLabels) {
  SegmentObject object = two_segments();
  object.segments = {"liver", "spleen", "absent"};
  // As dcmqi writes red, and the liver's colour of 3D Slicer.
  object.colors = {{34891, 53480, 50167}, {41661, 41167, 40792}, {0, 32896, 32896}};
  const Outcome outcome = imported(import_labels(object));
  LabelEntry liver = entry(1, "liver");
  LabelEntry spleen = entry(2, "spleen");
  liver.color = "#ff0000";
  spleen.color = "#dd8265";
  EXPECT_THAT(outcome.volume.labels, testing::ElementsAre(liver, spleen));
  EXPECT_THAT(note_detail(outcome, NoteCode::kLooksLikeLabels), HasSubstr("2 labels"));
  EXPECT_EQ(import_labels(object, {}, kBigEndian).volume.labels, outcome.volume.labels);
}

TEST(DicomSegmentation, WithOverlapsNumbersTheirCombinations) {
  SegmentObject object = two_segments();
  object.frames[2].labels = {3, 14};
  const Outcome outcome = imported(import_labels(object));
  EXPECT_EQ(outcome.volume.type, SampleType::kUint8);
  EXPECT_EQ(label_at(outcome, 14, 1), 3);
  EXPECT_EQ(label_at(outcome, 3, 1), 2);
  EXPECT_EQ(label_at(outcome, 7, 0), 1);
  EXPECT_THAT(outcome.volume.labels,
              testing::ElementsAre(entry(1, "liver", {1, 3}), entry(2, "spleen", {2, 3})));
  EXPECT_THAT(note_detail(outcome, NoteCode::kOverlappingSegments),
              HasSubstr("1 sample belongs to several segments"));
  // Frames may come in any order.
  std::swap(object.frames[1], object.frames[2]);
  EXPECT_EQ(import_labels(object).canonical, outcome.canonical);

  const Outcome chosen = imported(import_labels(object, {.volume = 1}));
  EXPECT_EQ(chosen.volume.dims[2], 2);
  EXPECT_EQ(label_at(chosen, 14, 0), 2);
  EXPECT_EQ(label_at(chosen, 1, 1), 2);
  EXPECT_EQ(chosen.volume.geometry.origin[2], 2);
  EXPECT_THAT(chosen.volume.labels, testing::ElementsAre(entry(2, "spleen")));
  EXPECT_THAT(import_labels(object, {.volume = 2}).error, HasSubstr("It has no volume 2"));
}

TEST(DicomSegmentation, WithOverlapsBeyondEightBitsHasWiderValues) {
  SegmentObject object = two_segments();
  for (SegmentFrame& frame : object.frames) {
    if (frame.segment == 2) frame.segment = 255;
  }
  object.frames[2].labels = {14};
  const Outcome outcome = imported(import_labels(object));
  const auto samples = samples_of<std::uint16_t>(outcome);
  EXPECT_EQ(samples.at(kSegmentSamples + 14), 256);
  EXPECT_EQ(samples.at(2 * kSegmentSamples + 1), 255);
  EXPECT_THAT(outcome.volume.labels,
              testing::ElementsAre(entry(1, "liver", {1, 256}), entry(255, "", {255, 256})));
}

// The numbers of combinations must not follow the order of planes and rows in the file.
TEST(DicomSegmentation, WithOverlapsIsOneVolumeInEachOrderOfItsPlanes) {
  SegmentObject object = {.frames = {{.z = 0, .segment = 1, .labels = {0, 12}},
                                     {.z = 0, .segment = 2, .labels = {0}},
                                     {.z = 0, .segment = 3, .labels = {12}},
                                     {.z = 2, .segment = 2, .labels = {4, 7}},
                                     {.z = 2, .segment = 3, .labels = {4, 7}}},
                          .segments = {"liver", "spleen", "lesion"}};
  const Outcome first = imported(import_objects({{"seg", segmentation(object).file(kExplicit)}}));
  // Rows run the other way, and so does the normal of the planes.
  for (SegmentFrame& frame : object.frames) {
    for (unsigned& place : frame.labels) {
      const unsigned row = place / kSegmentColumns;
      place += kSegmentColumns * (kSegmentRows - 1) - 2 * row * kSegmentColumns;
    }
  }
  DicomObject mirrored = segmentation(object);
  mirrored.items(kSharedFunctionalGroups, {shared_groups("0.5\\0.75", "1\\0\\0\\0\\-1\\0")});
  const Outcome other = imported(import_objects({{"seg", mirrored.file(kExplicit)}}));
  EXPECT_EQ(other.volume.stored_axes, "LAI");
  EXPECT_EQ(other.stored.substr(kHeaderBytes), first.stored.substr(kHeaderBytes));
  EXPECT_EQ(other.volume.labels, first.volume.labels);
  EXPECT_THAT(first.volume.labels,
              testing::ElementsAre(entry(1, "liver", {4, 5}), entry(2, "spleen", {4, 6}),
                                   entry(3, "lesion", {5, 6})));
}

TEST(DicomSegmentation, HasEmptyPlanesWhereFramesAreLeftOut) {
  SegmentObject object = two_segments();
  object.slice_distance = "1.0";
  const Outcome told = imported(import_labels(object));
  EXPECT_EQ(told.volume.dims[2], 5);
  EXPECT_EQ(told.volume.geometry.spacing[2], 1);
  EXPECT_THAT(note_detail(told, NoteCode::kEmptyPlanes), HasSubstr("2 of the 5 planes"));
  EXPECT_EQ(label_at(told, 14, 2), 1);
  for (unsigned place = 0; place < kSegmentSamples; ++place) {
    EXPECT_EQ(label_at(told, place, 1) + label_at(told, place, 3), 0);
  }
  // The stated slice distance applies only if the positions agree with it, and here they do not.
  object.slice_distance = "1.5";
  EXPECT_EQ(import_labels(object).volume.dims[2], 3);
  // Without it the smallest gap is the distance.
  object.slice_distance = "";
  object.frames[3].z = 12;
  const Outcome sparse = imported(import_labels(object));
  EXPECT_EQ(sparse.volume.dims[2], 7);
  EXPECT_EQ(label_at(sparse, 1, 6), 2);
}

TEST(DicomSegmentation, HasEmptyPlanesWhereGapsAreOfSeveralSlices) {
  SegmentObject object = two_segments();
  object.frames[3].z = 6;
  object.thickness = "1";
  const Outcome thick = imported(import_labels(object));
  EXPECT_EQ(thick.volume.dims[2], 7);
  EXPECT_EQ(thick.volume.geometry.spacing[2], 1);
  EXPECT_EQ(label_at(thick, 1, 6), 2);
  EXPECT_THAT(note_detail(thick, NoteCode::kDistanceAssumed), HasSubstr("thickness, 1 mm"));
  EXPECT_THAT(note_detail(thick, NoteCode::kEmptyPlanes), HasSubstr("4 of the 7 planes"));
  // The object's own distance counts, and a thickness that the gaps do not consist of does not.
  object.slice_distance = "2";
  EXPECT_EQ(import_labels(object).volume.dims[2], 4);
  object.slice_distance = "";
  for (const char* thickness : {"2", "1.5", "3", "0.001", "0"}) {
    object.thickness = thickness;
    const Outcome outcome = import_labels(object);
    EXPECT_EQ(outcome.volume.dims[2], 4) << thickness;
    EXPECT_EQ(note_detail(outcome, NoteCode::kDistanceAssumed), "") << thickness;
  }
}

std::string packed_bits(const SegmentFrame& frame) {
  std::string bytes((kSegmentSamples + 7) / 8, '\0');
  for (const unsigned place : frame.labels) {
    bytes[place / 8] = static_cast<char>(bytes[place / 8] | 1 << place % 8);
  }
  return bytes;
}

// One literal run in one segment, as in PS3.5, annex G.
std::string rle_of(const std::string& bytes) {
  std::string stream(64, '\0');
  stream[0] = 1;
  stream[4] = 64;
  stream += static_cast<char>(bytes.size() - 1) + bytes;
  return stream + std::string(stream.size() % 2, '\0');
}

// The segmentation of two_segments() with compressed frames.
Outcome import_frames(std::string_view syntax,
                      const std::function<std::string(const SegmentFrame&)>& compress) {
  const SegmentObject what = two_segments();
  std::vector<std::string> fragments;
  for (const SegmentFrame& frame : what.frames) fragments.push_back(compress(frame));
  DicomObject object = segmentation(what);
  object.fragments(fragments, {});
  return described(import_objects({{"seg", object.file(syntax)}}), what);
}

// Each frame begins at a byte when it is compressed, though it has 15 bits.
TEST(DicomSegmentation, MayHaveCompressedFrames) {
  const std::string expected = import_labels(two_segments()).canonical;
  const auto as_bytes = [](const SegmentFrame& frame) {
    std::string bytes(kSegmentSamples, '\0');
    for (const unsigned place : frame.labels) bytes[place] = 1;
    return bytes;
  };
  const Outcome deflated = imported(import_frames(kDeflatedFrames, [](const SegmentFrame& frame) {
    return isomesh::test::raw_deflate(packed_bits(frame));
  }));
  EXPECT_EQ(deflated.canonical, expected);
  const Outcome runs = imported(
      import_frames(kRle, [](const SegmentFrame& frame) { return rle_of(packed_bits(frame)); }));
  EXPECT_EQ(runs.canonical, expected);
  // Some programs write a byte for each bit.
  const Outcome bytes =
      import_frames(kRle, [&](const SegmentFrame& frame) { return rle_of(as_bytes(frame)); });
  EXPECT_EQ(bytes.canonical, expected);
}

TEST(DicomSegmentation, WithFramesThatEndEarlyIsRefused) {
  EXPECT_THAT(import_frames(kRle, [](const SegmentFrame&) { return rle_of("x"); }).error,
              HasSubstr("end before its size does"));
  EXPECT_THAT(import_frames(kDeflatedFrames,
                            [](const SegmentFrame&) { return isomesh::test::raw_deflate("x"); })
                  .error,
              HasSubstr("end before its size does"));
  EXPECT_THAT(
      import_frames(kDeflatedFrames, [](const SegmentFrame&) { return std::string("abcd"); }).error,
      HasSubstr("corrupt or truncated"));
}

TEST(DicomSegmentation, OfUnevenFramesIsRefused) {
  SegmentObject object = two_segments();
  object.frames[3].z = 5;
  EXPECT_THAT(import_labels(object).error, HasSubstr("unevenly spaced"));
  object.frames = {{.z = 3, .segment = 1, .labels = {1}}, {.z = 3, .segment = 2, .labels = {2}}};
  EXPECT_THAT(import_labels(object).error, HasSubstr("one plane, and does not say how thick"));
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
  EXPECT_THAT(import_labels(object).error, HasSubstr("the segment of its frame 3"));
}

TEST(DicomSegmentation, OfOneFractionalSegmentKeepsItsSamples) {
  const SegmentObject object = {.frames = {{.z = 0, .segment = 1, .labels = {2}, .value = 200},
                                           {.z = 1, .segment = 1, .labels = {3}, .value = 60}},
                                .segments = {"liver"},
                                .type = "FRACTIONAL",
                                .maximum = 255};
  const Outcome outcome = imported(import_labels(object));
  EXPECT_EQ(label_at(outcome, 2, 0), 200);
  EXPECT_EQ(label_at(outcome, 3, 1), 60);
  EXPECT_EQ(outcome.volume.suggested_iso, 127.5);
  EXPECT_THAT(outcome.volume.presets, testing::ElementsAre(Preset{"segment", 127.5}));
  EXPECT_THAT(note_detail(outcome, NoteCode::kFractionalSegments), HasSubstr("127.5 or more"));
  EXPECT_THAT(outcome.volume.labels, testing::IsEmpty());
}

TEST(DicomSegmentation, OfFractionalSegmentsBeginsAtAHalf) {
  SegmentObject object = two_segments();
  object.type = "FRACTIONAL";
  object.maximum = 101;
  object.frames[0].value = 51;
  object.frames[1].value = 101;
  object.frames[2] = {.z = 2, .segment = 2, .labels = {3, 14}, .value = 255};
  object.frames[3].value = 50;
  const Outcome outcome = imported(import_labels(object));
  EXPECT_EQ(label_at(outcome, 7, 0), 1);
  EXPECT_EQ(label_at(outcome, 14, 1), 3);
  EXPECT_EQ(label_at(outcome, 3, 1), 2);
  EXPECT_EQ(label_at(outcome, 1, 2), 0);
  EXPECT_THAT(note_detail(outcome, NoteCode::kFractionalSegments), HasSubstr("50.5 or more"));
  EXPECT_THAT(outcome.volume.presets, testing::IsEmpty());
  // One of them alone is as it is stored.
  const Outcome chosen = imported(import_labels(object, {.volume = 1}));
  EXPECT_EQ(label_at(chosen, 1, 1), 50);
}

TEST(DicomSegmentation, OfAnUnknownKindIsRefused) {
  SegmentObject object = two_segments();
  object.type = "FRACTIONAL";
  EXPECT_THAT(import_labels(object).error, HasSubstr("largest value"));
  object.type = "SURFACE";
  EXPECT_THAT(import_labels(object).error, HasSubstr("\"SURFACE\""));
}

TEST(DicomSegmentation, OfLabelsKeepsThem) {
  const SegmentObject object = {.frames = {{.z = 0, .labels = {2}}, {.z = 5, .labels = {3}}},
                                .type = "LABELMAP",
                                .slice_distance = "2.5"};
  const Outcome outcome = imported(import_labels(object));
  EXPECT_EQ(outcome.volume.dims[2], 3);
  EXPECT_EQ(outcome.volume.geometry.spacing[2], 2.5);
  EXPECT_EQ(label_at(outcome, 2, 0), 7);
  EXPECT_EQ(label_at(outcome, 3, 2), 7);
  EXPECT_EQ(outcome.volume.range, (std::array<double, 2>{0, 7}));
  EXPECT_THAT(outcome.volume.labels, testing::ElementsAre(entry(1, "liver"), entry(2, "spleen")));
  // Colours for the labels do not change them.
  const Outcome coloured = import_objects(
      {{"seg",
        segmentation(object).text(kPhotometricInterpretation, "CS", "PALETTE COLOR").file()}});
  EXPECT_EQ(described(coloured, object).canonical, outcome.canonical);
  EXPECT_EQ(coloured.volume.labels, outcome.volume.labels);
}

// Programs write different things of them, and their surfaces do not differ.
TEST(DicomSegmentation, IsClosedWhereFramesAreLeftOut) {
  const SegmentObject sparse = {
      .frames = {{.z = 2, .segment = 1, .labels = {7}}, {.z = 4, .segment = 1, .labels = {7}}},
      .segments = {"liver"}};
  SegmentObject whole = sparse;
  whole.frames.insert(whole.frames.begin(), {.z = 0, .segment = 1, .labels = {}});
  whole.frames.push_back({.z = 6, .segment = 1, .labels = {}});
  const Outcome closed = imported(import_objects({{"seg", segmentation(sparse).file()}}));
  const Outcome told = imported(import_objects({{"seg", segmentation(whole).file()}}));
  EXPECT_EQ(closed.canonical, told.canonical);
  EXPECT_EQ(
      note_detail(closed, NoteCode::kEmptyPlanes),
      "Labels reach the end of the segmentation at 2 sides. A plane of zeros was added there.");
  EXPECT_EQ(note_detail(told, NoteCode::kEmptyPlanes), "");
}

TEST(DicomSegmentation, OfOnePlaneIsAsThickAsItsSlice) {
  SegmentObject object = {.frames = {{.z = 3, .segment = 1, .labels = {7}}}, .segments = {"liver"}};
  const auto import = [&](const ImportOptions& options = {}) {
    return import_objects({{"seg", segmentation(object).file()}}, options);
  };
  const Outcome unknown = import();
  EXPECT_THAT(unknown.error, HasSubstr("does not say how thick it is"));
  ASSERT_EQ(unknown.remedy.choices.size(), 1U);
  EXPECT_EQ(unknown.remedy.choices[0].parameter, "spacing");
  EXPECT_EQ(unknown.remedy.choices[0].value, "0.75,0.5,1");
  EXPECT_EQ(imported(import({.spacing = {{1, 1, 4}}})).volume.geometry.spacing,
            (std::array<double, 3>{0.75, 0.5, 4}));
  object.thickness = "2.5";
  const Outcome thick = imported(import());
  EXPECT_EQ(thick.volume.dims, (std::array<std::uint32_t, 3>{kSegmentColumns, kSegmentRows, 3}));
  EXPECT_EQ(thick.volume.geometry.spacing[2], 2.5);
  EXPECT_EQ(thick.volume.geometry.origin, (std::array<double, 3>{0, 0, 0.5}));
  EXPECT_EQ(label_at(thick, 7, 1), 1);
  EXPECT_THAT(note_detail(thick, NoteCode::kDistanceAssumed), HasSubstr("2.5 mm"));
  object.slice_distance = "2";
  EXPECT_EQ(imported(import()).volume.geometry.spacing[2], 2);
  EXPECT_EQ(note_detail(import(), NoteCode::kDistanceAssumed), "");
  EXPECT_EQ(import({.spacing = {{1, 1, 4}}}).code, ErrorCode::kInvalidParameter);
  object = two_segments();
  EXPECT_EQ(import({.spacing = {{1, 1, 4}}}).code, ErrorCode::kInvalidParameter);
  // The only plane of a segment is as thick as the planes of all are apart.
  object.frames.pop_back();
  EXPECT_EQ(imported(import({.volume = 1})).volume.geometry.spacing[2], 2);
}

// PS3.3, C.8.20.2: samples of no segment have the padding value.
TEST(DicomSegmentation, OfLabelsHasABackgroundOfAnyValue) {
  const SegmentObject object = {
      .frames = {{.z = 0, .labels = {2}, .value = 1}, {.z = 1, .labels = {3}, .value = 2}},
      .type = "LABELMAP"};
  const Outcome plain = imported(import_labels(object));
  std::string samples(2 * kSegmentSamples, '\xFF');
  samples[2] = '\1';
  samples[kSegmentSamples + 3] = '\2';
  const auto import = [&](unsigned padding) {
    return described(imported(import_objects({{"seg", segmentation(object)
                                                          .number(kPixelPaddingValue, padding)
                                                          .pixels(samples, 1)
                                                          .file()}})),
                     object);
  };
  EXPECT_EQ(import(255).canonical, plain.canonical);
  EXPECT_EQ(import(255).volume.labels, plain.volume.labels);
  // No sample of eight bits has this value.
  EXPECT_EQ(import(65535).sample_bytes(), samples);
  // The other segment's number.
  samples.assign(2 * kSegmentSamples, '\2');
  samples[2] = '\1';
  const Outcome second = import(2);
  EXPECT_EQ(second.volume.range, (std::array<double, 2>{0, 1}));
  EXPECT_THAT(second.volume.labels, testing::ElementsAre(entry(1, "liver")));
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
  const Outcome second = import_objects(files, {.volume = 1});
  EXPECT_EQ(described(second, two_segments()).sample_bytes(),
            import_labels(two_segments()).sample_bytes());
}

}  // namespace
}  // namespace isomesh::import::test
