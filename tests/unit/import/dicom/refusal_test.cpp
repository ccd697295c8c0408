// DICOM that makes no trustworthy volume: refused with the reason, naming slices.
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/base64.h"
#include "server/import/dicom/elements/tags.h"
#include "server/import/dicom/import.h"
#include "tests/unit/import/archives.h"
#include "tests/unit/import/dicom/objects.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using namespace dicom;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

// The files without some, the first of which is 0.
NamedFiles without(NamedFiles files, const std::vector<std::size_t>& slices) {
  for (auto at = slices.rbegin(); at != slices.rend(); ++at) {
    files.erase(files.begin() + static_cast<std::ptrdiff_t>(*at));
  }
  return files;
}

NamedFiles in_order(const DicomSeries& series) {
  return changed(series, [](DicomObject&) {});
}

using Edit = std::function<void(DicomObject&)>;

Edit setting(Tag tag, const char* vr, const char* value) {
  return [=](DicomObject& object) { object.text(tag, vr, value); };
}
Edit setting(Tag tag, unsigned value) {
  return [=](DicomObject& object) { object.number(tag, value); };
}
Edit erasing(Tag tag) {
  return [=](DicomObject& object) { object.erase(tag); };
}

NamedFiles with_slice(std::uint32_t number, const Edit& change) {
  return changed(DicomSeries{}, [&](DicomObject& object, std::uint32_t k) {
    if (k == number) change(object);
  });
}

const DicomSeries kLong = {.slices = 93};

// Slices are numbered as by the scanner.
TEST(DicomRefusal, NamesMissingSlices) {
  const Outcome outcome = import_objects(without(in_order(kLong), {40}));
  EXPECT_EQ(outcome.code, ErrorCode::kUnusableVolume);
  EXPECT_THAT(outcome.error, AllOf(HasSubstr("slice 41 of 93 is missing"),
                                   HasSubstr("between \"IM40\" and \"IM42\"")));
  const DicomSeries downward = {.slices = 93, .step = {0, 0, -2.5}};
  EXPECT_THAT(import_objects(without(in_order(downward), {40})).error,
              HasSubstr("slice 41 of 93 is missing"));
  EXPECT_THAT(import_objects(without(in_order(kLong), {10, 40, 41})).error,
              HasSubstr("slices 11, 41 and 42 of 93 are missing"));
}

TEST(DicomRefusal, KeepsTheSpacingThatTheScannerGave) {
  const Outcome outcome = import_objects(DicomSeries{}.files(), {.spacing = {{1, 1, 1}}});
  EXPECT_EQ(outcome.code, ErrorCode::kInvalidParameter);
  EXPECT_THAT(outcome.error, HasSubstr("this file has its own"));
}

TEST(DicomRefusal, NamesADoubledSlice) {
  NamedFiles files = in_order(DicomSeries{});
  files.emplace_back("again", DicomSeries{}.slice(2).pixels(std::string(40, 'x'), 2).file());
  const Outcome outcome = import_objects(files);
  EXPECT_EQ(outcome.code, ErrorCode::kUnusableVolume);
  EXPECT_THAT(outcome.error, AllOf(HasSubstr("occurs more than once"), HasSubstr("\"IM3\""),
                                   HasSubstr("\"again\"")));
}

TEST(DicomRefusal, NamesUnevenSlices) {
  const Outcome outcome = import_objects(
      with_slice(3, setting(kImagePosition, "DS", "-10\\20\\37.9")));  // 37.5 would be right
  EXPECT_THAT(outcome.error, AllOf(HasSubstr("unevenly spaced"), HasSubstr("slices 3 and 4 of 6"),
                                   HasSubstr("2.9 mm"), HasSubstr("2.5 mm")));
}

TEST(DicomRefusal, NamesASliceThatIsShiftedInItsPlane) {
  const Outcome outcome =
      import_objects(with_slice(3, setting(kImagePosition, "DS", "-10.5\\20\\37.5")));
  EXPECT_THAT(outcome.error, AllOf(HasSubstr("Slice 4 of 6"), HasSubstr("0.5 mm")));
}

TEST(DicomRefusal, NamesASliceOfAnotherKind) {
  const std::pair<Edit, const char*> mixtures[] = {
      {setting(kImageOrientation, "DS", "0\\1\\0\\1\\0\\0"), "orientation"},
      {[](DicomObject& object) { object.number(kRows, 2).pixels(std::string(20, 'x'), 2); },
       "size"},
      {setting(kPixelSpacing, "DS", "0.5\\0.8"), "pixel spacing"},
      {setting(kPhotometricInterpretation, "CS", "MONOCHROME1"), "photometric"}};
  for (const auto& [change, what] : mixtures) {
    const Outcome outcome = import_objects(with_slice(4, change));
    EXPECT_EQ(outcome.code, ErrorCode::kUnusableVolume);
    EXPECT_THAT(outcome.error,
                AllOf(HasSubstr("1 of its 6 slices"), HasSubstr(what), HasSubstr("\"IM5\"")));
  }
}

NamedFiles rescaled(const char* slope, const char* intercept, const Edit& change) {
  return changed(DicomSeries{}, [&](DicomObject& object, std::uint32_t k) {
    object.text(kRescaleSlope, "DS", slope).text(kRescaleIntercept, "DS", intercept);
    if (k == 4) change(object);
  });
}

TEST(DicomRescale, ThatOneSliceLacksIsRefused) {
  const auto error_of = [](const NamedFiles& files) { return import_objects(files).error; };
  const auto without_both = [](DicomObject& object) {
    object.erase(kRescaleSlope).erase(kRescaleIntercept);
  };
  EXPECT_THAT(
      error_of(rescaled("1", "-1024", without_both)),
      AllOf(HasSubstr("1 of its 6 slices differs in having a rescale intercept (0028,1052)"),
            HasSubstr("\"IM5\"")));
  EXPECT_THAT(error_of(rescaled("2", "0", without_both)),
              AllOf(HasSubstr("rescale slope (0028,1053)"), HasSubstr("\"IM5\"")));
  // An empty value is missing, too.
  EXPECT_THAT(error_of(rescaled("1", "-1024", setting(kRescaleIntercept, "DS", ""))),
              HasSubstr("rescale intercept"));
  // The assumed factors are those of the others.
  EXPECT_EQ(error_of(rescaled("1", "0", without_both)), "");
  EXPECT_EQ(error_of(rescaled("1", "-1024", erasing(kRescaleSlope))), "");
}

TEST(DicomRescale, MayDifferFromSliceToSlice) {
  EXPECT_EQ(import_objects(rescaled("1", "-1024", setting(kRescaleSlope, "DS", "0.5"))).error, "");
}

TEST(DicomRescale, ThatOneFrameLacksIsRefused) {
  const DicomSeries series;
  std::vector<DicomObject> frames;
  for (std::uint32_t k = 0; k < series.slices; ++k) {
    DicomObject frame = frame_at(series.position(k));
    if (k != 2) {
      frame.items(
          kPixelValueTransformationSequence,
          {DicomObject().text(kRescaleSlope, "DS", "1").text(kRescaleIntercept, "DS", "-1024")});
    }
    frames.push_back(frame);
  }
  DicomObject object = series.enhanced({0, 1, 2, 3, 4, 5});
  object.items(kPerFrameFunctionalGroups, frames);
  EXPECT_THAT(import_objects({{"one", object.file()}}).error,
              AllOf(HasSubstr("rescale intercept"), HasSubstr("frame 3 differs from")));
}

TEST(DicomTable, ThatOneSliceLacksIsRefused) {
  const NamedFiles files = with_slice(4, [](DicomObject& object) {
    object.items(kModalityLutSequence,
                 {DicomObject().numbers(kLutDescriptor, {1, 0, 16}).bytes(kLutData, "OW", "ab")});
  });
  EXPECT_THAT(import_objects(files).error,
              AllOf(HasSubstr("1 of its 6 slices"), HasSubstr("\"IM5\"")));
}

// --- Single objects ------------------------------------------------------------------------------

TEST(DicomRefusal, OfASliceTellsItsReason) {
  const std::pair<Edit, const char*> faults[] = {
      {erasing(kPixelData), "no pixel data"},
      {[](DicomObject& object) { object.pixels(std::string(38, 'x'), 2); },
       "5 x 4 x 1 samples take 40 bytes, but the file has 38"},
      {[](DicomObject& object) { object.number(kRows, 65535).number(kColumns, 65535); },
       "65535 x 65535 x 1 samples take 8589672450 bytes, but the file has 40"},
      {erasing(kRows), "rows (0028,0010)"},
      {setting(kRows, 0), "size is 0"},
      {setting(kBitsStored, 17), "it stores 17 bits"},
      {setting(kBitsAllocated, 12), "12 bits"},
      {[](DicomObject& object) {
         object.number(kSamplesPerPixel, 3).text(kPhotometricInterpretation, "CS", "RGB");
       },
       "in colour"},
      {setting(kPhotometricInterpretation, "CS", "PALETTE COLOR"), "palette"},
      {erasing(kImagePosition), "position (0020,0032)"},
      {setting(kImagePosition, "DS", "a\\b\\c"), "\"a\\b\\c\""},
      {setting(kImagePosition, "DS", "1\\nan\\2"), "not 3 numbers"},
      {erasing(kPixelSpacing), "pixel spacing (0028,0030)"},
      {setting(kPixelSpacing, "DS", "0\\1"), "not positive"},
      {setting(kImageOrientation, "DS", "2\\0\\0\\0\\1\\0"), "unit vectors"},
      {setting(kImageOrientation, "DS", "1\\0\\0\\0.6\\0.8\\0"), "perpendicular"},
      {[](DicomObject& object) { object.items(kModalityLutSequence, {DicomObject{}}); },
       "by a lookup table"},
      {[](DicomObject& object) {
         object.text(kNumberOfFrames, "IS", "2").pixels(std::string(80, 'x'), 2);
       },
       "no position for each of them"},
      {setting(kNumberOfFrames, "IS", "-1"), "\"-1\""}};
  for (const auto& [change, reason] : faults) {
    const Outcome outcome = import_objects(with_slice(2, change));
    EXPECT_EQ(outcome.code, ErrorCode::kUnusableVolume);
    EXPECT_THAT(outcome.error, AllOf(HasSubstr("File \"IM3\""), HasSubstr(reason)));
    // Alone it needs no name, and must not have the one of the daemon's own file.
    DicomObject object = DicomSeries{}.slice(2);
    change(object);
    const std::string alone = import_objects({{"upload-17", object.file()}}).error;
    EXPECT_THAT(alone, AllOf(HasSubstr(reason), Not(HasSubstr("upload-17"))));
  }
}

TEST(DicomRefusal, OfASingleSlice) {
  const Outcome outcome = import_objects({{"one", DicomSeries{}.slice(0).file()}});
  EXPECT_EQ(outcome.code, ErrorCode::kUnusableVolume);
  EXPECT_THAT(outcome.error, HasSubstr("1 slice of 5 x 4 samples"));
}

TEST(DicomRefusal, OfWhatExceedsTheLimits) {
  const Outcome outcome =
      import_objects(DicomSeries{}.files(), {}, {.max_sample_bytes = 6 * 20 * 2 - 1});
  EXPECT_EQ(outcome.code, ErrorCode::kTooLarge);
  EXPECT_EQ(import_objects(DicomSeries{}.files(), {}, {.max_sample_bytes = 6 * 20 * 2}).error, "");
}

TEST(DicomRefusal, OfAFileThatInflatesWithoutEnd) {
  DicomObject object = DicomSeries{}.slice(0);
  object.pixels(std::string(std::size_t{80} << 20, '\0'), 2);
  const Outcome outcome =
      import_objects({{"bomb", object.file(kDeflate)}}, {}, {.max_sample_bytes = 1 << 20});
  EXPECT_EQ(outcome.code, ErrorCode::kUnusableVolume);
  EXPECT_THAT(outcome.error, HasSubstr("compressed file unpacks to more"));
}

TEST(DicomRefusal, OfACompressedFileThatHoldsMoreThanItsHeaderTells) {
  const std::string zeros(std::size_t{80} << 20, '\0');
  const DicomObject enhanced = DicomSeries{}.enhanced({0, 1, 2, 3, 4, 5});
  EXPECT_TRUE(import_bytes(gzip(enhanced.file())).imported());
  EXPECT_THAT(import_bytes(gzip(enhanced.file() + zeros)).error, HasSubstr("unpacks to more"));
  EXPECT_THAT(import_bytes(gzip(enhanced.file(kImplicit) + zeros)).error,
              HasSubstr("unpacks to more"));
  EXPECT_THAT(import_bytes(zip({{"a.dcm", enhanced.file() + zeros}})).error,
              HasSubstr("that its header allows"));
  EXPECT_THAT(import_bytes(zip({{"a.dcm.gz", gzip(enhanced.file() + zeros)}})).error,
              HasSubstr("unpacks to more"));
}

TEST(DicomRefusal, OfEveryTruncation) {
  const std::string whole = DicomSeries{}.enhanced({0, 1, 2, 3, 4, 5}).file();
  ASSERT_EQ(import_objects({{"whole", whole}}).error, "");
  for (std::size_t size = 132; size < whole.size(); size += size < 600 ? 1 : 7) {
    const Outcome outcome = import_objects({{"cut", whole.substr(0, size)}});
    ASSERT_NE(outcome.error, "") << size;
    ASSERT_EQ(outcome.code, ErrorCode::kUnusableVolume) << size << ": " << outcome.error;
  }
}

TEST(DicomRefusal, OfSequencesThatLieTooDeep) {
  DicomObject deep;
  for (int depth = 0; depth < 40; ++depth) {
    DicomObject outer;
    deep = outer.items(kPlanePositionSequence, {deep});
  }
  DicomObject object = DicomSeries{}.slice(0);
  object.items(kPlanePositionSequence, {deep});
  EXPECT_THAT(import_objects({{"deep", object.file()}}).error, HasSubstr("nested more than"));
}

// --- Several series and other objects ------------------------------------------------------------

NamedFiles two_series() {
  NamedFiles files = changed({}, setting(kStudyInstanceUid, "UI", "1.2.3"));
  const NamedFiles others =
      changed({.slices = 4, .uid = "1.2.3.9"}, setting(kSeriesDescription, "LO", "scout"));
  for (const auto& [name, file] : others) files.emplace_back("B" + name, file);
  return files;
}

TEST(DicomChoice, IsAskedForWhenThereAreSeveralSeries) {
  const Outcome outcome = import_objects(two_series());
  EXPECT_EQ(outcome.code, ErrorCode::kUnusableVolume);
  EXPECT_THAT(outcome.error, HasSubstr("2 series"));
  ASSERT_EQ(outcome.remedy.choices.size(), 2);
  const Choice& first = outcome.remedy.choices[0];
  const Choice& second = outcome.remedy.choices[1];
  EXPECT_EQ(first.title, "CT, 6 slices");
  EXPECT_EQ(second.value, "1.2.3.9");
  EXPECT_EQ(second.title, "scout, CT, 4 slices");
  // They are shown to a person, who knows them by these.
  ASSERT_TRUE(first.series && first.picture);
  EXPECT_EQ(first.series->study_uid, "1.2.3");
  const ChoicePicture& picture = *first.picture;
  EXPECT_EQ(from_base64(picture.grey)->size(), std::size_t{picture.width} * picture.height);
}

TEST(DicomChoice, TakesTheSeriesThatIsNamed) {
  const Outcome outcome = imported(import_objects(two_series(), {.series = "1.2.3.9"}));
  EXPECT_EQ(outcome.volume.dims[2], 4);
  EXPECT_EQ(outcome.volume.dicom->series_uid, "1.2.3.9");
}

TEST(DicomChoice, ListsAllForAnUnknownName) {
  const Outcome outcome = import_objects(two_series(), {.series = "1.2"});
  EXPECT_EQ(outcome.code, ErrorCode::kUnusableVolume);
  EXPECT_THAT(outcome.error, HasSubstr("\"1.2\""));
  EXPECT_EQ(outcome.remedy.choices.size(), 2);
}

TEST(DicomChoice, IsNotHinderedByFaultsOfOthers) {
  NamedFiles files = DicomSeries{}.files();
  files.emplace_back("report", DicomSeries{.uid = "1.9"}
                                   .slice(0)
                                   .number(kSamplesPerPixel, 3)
                                   .text(kPhotometricInterpretation, "CS", "RGB")
                                   .file());
  EXPECT_EQ(import_objects(files).remedy.choices.size(), 2);
  EXPECT_EQ(import_objects(files, {.series = "1.2.3.4"}).error, "");
  EXPECT_THAT(import_objects(files, {.series = "1.9"}).error, HasSubstr("in colour"));
}

TEST(DicomIgnored, AreNamedWithTheirReasons) {
  NamedFiles files = DicomSeries{}.files();
  files.emplace_back(
      "report.dcm",
      DicomObject().text(kModality, "CS", "SR").text(kSeriesInstanceUid, "UI", "1.2.77").file());
  files.emplace_back("DICOMDIR", DicomObject().items(kDirectoryRecordSequence, {}).file());
  files.emplace_back("readme.txt", "not DICOM");
  files.emplace_back("empty", "");
  files.emplace_back("scout", DicomSeries{.along_column = {0, 0, -1}}
                                  .slice(0)
                                  .text(kImageType, "CS", "ORIGINAL\\PRIMARY\\LOCALIZER")
                                  .file());
  const Outcome outcome = imported(import_objects(files));
  EXPECT_THAT(
      outcome.volume.ignored,
      testing::ElementsAre(IgnoredObject{"report.dcm", "it is not an image (modality \"SR\")"},
                           IgnoredObject{"DICOMDIR", "it is a directory of DICOM files"},
                           IgnoredObject{"readme.txt", "it is not a DICOM file"},
                           IgnoredObject{"empty", "it is not a DICOM file"},
                           IgnoredObject{"scout", "it is a localiser"}));
}

TEST(DicomIgnored, MakeNoVolume) {
  DicomObject report;
  report.text(kModality, "CS", "SR");
  EXPECT_THAT(import_objects({{"a", report.file()}}).error, HasSubstr("not an image"));
  EXPECT_THAT(import_objects({{"a", report.file()}, {"b", "text"}}).error,
              HasSubstr("None of the upload's 2 files"));
}

}  // namespace
}  // namespace isomesh::import::test
