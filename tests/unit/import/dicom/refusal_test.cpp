// DICOM that makes no trustworthy volume: refused with the reason, naming slices.
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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

// The files of a series of which some slices are left out, changed or moved.
NamedFiles files_of(const DicomSeries& series,
                    const std::function<bool(std::uint32_t, DicomObject&)>& keep) {
  NamedFiles files;
  for (std::uint32_t k = 0; k < series.slices; ++k) {
    DicomObject object = series.slice(k);
    if (keep(k, object)) files.emplace_back("IM" + std::to_string(k + 1), object.file());
  }
  return files;
}

NamedFiles with_slice(std::uint32_t number, const std::function<void(DicomObject&)>& change) {
  return files_of(DicomSeries{}, [&](std::uint32_t k, DicomObject& object) {
    if (k == number) change(object);
    return true;
  });
}

DicomSeries long_series() {
  DicomSeries series;
  series.slices = 93;
  return series;
}

TEST(DicomRefusal, NamesAMissingSlice) {
  const Outcome outcome = import_objects(
      files_of(long_series(), [](std::uint32_t k, DicomObject&) { return k != 40; }));
  EXPECT_EQ(outcome.code, ErrorCode::kUnusableVolume);
  EXPECT_THAT(outcome.error, HasSubstr("slice 41 of 93 is missing"));
}

TEST(DicomRefusal, KeepsTheSpacingThatTheScannerGave) {
  const Outcome outcome =
      import_objects(files_of(DicomSeries{}, [](std::uint32_t, DicomObject&) { return true; }),
                     {.spacing = {{1, 1, 1}}});
  EXPECT_EQ(outcome.code, ErrorCode::kInvalidParameter);
  EXPECT_THAT(outcome.error, HasSubstr("this file has its own"));
}

TEST(DicomRefusal, NumbersSlicesAsTheScannerDid) {
  DicomSeries series = long_series();
  series.step = {0, 0, -2.5};
  const Outcome outcome =
      import_objects(files_of(series, [](std::uint32_t k, DicomObject&) { return k != 40; }));
  EXPECT_THAT(outcome.error, HasSubstr("slice 41 of 93 is missing"));
}

TEST(DicomRefusal, NamesSeveralMissingSlices) {
  const Outcome outcome = import_objects(files_of(
      long_series(), [](std::uint32_t k, DicomObject&) { return k != 10 && k != 40 && k != 41; }));
  EXPECT_THAT(outcome.error, HasSubstr("slices 11, 41 and 42 of 93 are missing"));
}

TEST(DicomRefusal, NamesADoubledSlice) {
  NamedFiles files = DicomSeries{}.files();
  files.emplace_back("again", DicomSeries{}.slice(2).text(kContentTime, "TM", "1200").file());
  const Outcome outcome = import_objects(files);
  EXPECT_EQ(outcome.code, ErrorCode::kUnusableVolume);
  EXPECT_THAT(outcome.error, HasSubstr("Slice 3 of 6 occurs more than once"));
}

TEST(DicomRefusal, NamesUnevenSlices) {
  const Outcome outcome = import_objects(with_slice(3, [](DicomObject& object) {
    object.text(kImagePosition, "DS", "-10\\20\\37.9");  // 37.5 would be right
  }));
  EXPECT_THAT(outcome.error, AllOf(HasSubstr("unevenly spaced"), HasSubstr("slices 3 and 4 of 6"),
                                   HasSubstr("2.9 mm"), HasSubstr("2.5 mm")));
}

TEST(DicomRefusal, NamesASliceThatIsShiftedInItsPlane) {
  const Outcome outcome = import_objects(with_slice(
      3, [](DicomObject& object) { object.text(kImagePosition, "DS", "-10.5\\20\\37.5"); }));
  EXPECT_THAT(outcome.error, AllOf(HasSubstr("Slice 4 of 6"), HasSubstr("0.5 mm")));
}

struct Mixture {
  const char* name;
  std::function<void(DicomObject&)> change;
  const char* what;
};

class DicomMixture : public testing::TestWithParam<Mixture> {};

TEST_P(DicomMixture, IsRefusedAndNamed) {
  const Outcome outcome = import_objects(with_slice(4, GetParam().change));
  EXPECT_EQ(outcome.code, ErrorCode::kUnusableVolume);
  EXPECT_THAT(outcome.error, AllOf(HasSubstr("1 of its 6 slices"), HasSubstr(GetParam().what),
                                   HasSubstr("\"IM5\"")));
}

INSTANTIATE_TEST_SUITE_P(
    Of, DicomMixture,
    testing::Values(Mixture{"Orientations",
                            [](DicomObject& object) {
                              object.text(kImageOrientation, "DS", "0\\1\\0\\1\\0\\0");
                            },
                            "orientation"},
                    Mixture{"Sizes",
                            [](DicomObject& object) {
                              object.number(kRows, 2).pixels(std::string(20, 'x'), 2);
                            },
                            "size"},
                    Mixture{
                        "Spacings",
                        [](DicomObject& object) { object.text(kPixelSpacing, "DS", "0.5\\0.8"); },
                        "pixel spacing"},
                    Mixture{"Photometry",
                            [](DicomObject& object) {
                              object.text(kPhotometricInterpretation, "CS", "MONOCHROME1");
                            },
                            "photometric"}),
    [](const auto& each) { return std::string(each.param.name); });

NamedFiles rescaled(const char* slope, const char* intercept,
                    const std::function<void(DicomObject&)>& change) {
  return files_of(DicomSeries{}, [&](std::uint32_t k, DicomObject& object) {
    object.text(kRescaleSlope, "DS", slope).text(kRescaleIntercept, "DS", intercept);
    if (k == 4) change(object);
    return true;
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
  EXPECT_THAT(
      error_of(rescaled("1", "-1024",
                        [](DicomObject& object) { object.text(kRescaleIntercept, "DS", ""); })),
      HasSubstr("rescale intercept"));
  // The assumed factors are those of the others.
  EXPECT_EQ(error_of(rescaled("1", "0", without_both)), "");
  EXPECT_EQ(
      error_of(rescaled("1", "-1024", [](DicomObject& object) { object.erase(kRescaleSlope); })),
      "");
}

TEST(DicomRescale, MayDifferFromSliceToSlice) {
  EXPECT_EQ(
      import_objects(rescaled("1", "-1024",
                              [](DicomObject& object) { object.text(kRescaleSlope, "DS", "0.5"); }))
          .error,
      "");
}

TEST(DicomRescale, ThatOneFrameLacksIsRefused) {
  const DicomSeries series;
  std::vector<DicomObject> frames;
  for (std::uint32_t k = 0; k < series.slices; ++k) {
    DicomObject frame;
    frame.items(kPlanePositionSequence,
                {DicomObject().text(kImagePosition, "DS",
                                    "-10\\20\\" + std::to_string(series.position(k)[2]))});
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

struct Fault {
  const char* name;
  std::function<void(DicomObject&)> change;
  const char* reason;
};

class DicomFault : public testing::TestWithParam<Fault> {};

TEST_P(DicomFault, IsRefusedWithItsReason) {
  const Outcome outcome = import_objects(with_slice(2, GetParam().change));
  EXPECT_EQ(outcome.code, ErrorCode::kUnusableVolume);
  EXPECT_THAT(outcome.error, AllOf(HasSubstr("File \"IM3\""), HasSubstr(GetParam().reason)));
  // Alone it needs no name, and must not have the one of the daemon's own file.
  DicomObject object = DicomSeries{}.slice(2);
  GetParam().change(object);
  const std::string alone = import_objects({{"upload-17", object.file()}}).error;
  EXPECT_THAT(alone, AllOf(HasSubstr(GetParam().reason), Not(HasSubstr("upload-17"))));
}

INSTANTIATE_TEST_SUITE_P(
    Of, DicomFault,
    testing::Values(
        Fault{"NoPixels", [](DicomObject& object) { object.erase(kPixelData); }, "no pixel data"},
        Fault{"FewPixels", [](DicomObject& object) { object.pixels(std::string(38, 'x'), 2); },
              "5 x 4 x 1 samples take 40 bytes, but the file has 38"},
        Fault{"HugeSize",
              [](DicomObject& object) { object.number(kRows, 65535).number(kColumns, 65535); },
              "65535 x 65535 x 1 samples take 8589672450 bytes, but the file has 40"},
        Fault{"NoRows", [](DicomObject& object) { object.erase(kRows); }, "rows (0028,0010)"},
        Fault{"ZeroRows", [](DicomObject& object) { object.number(kRows, 0); }, "size is 0"},
        Fault{"Bits", [](DicomObject& object) { object.number(kBitsStored, 17); },
              "it stores 17 bits"},
        Fault{"PackedBits", [](DicomObject& object) { object.number(kBitsAllocated, 12); },
              "12 bits"},
        Fault{"Colour",
              [](DicomObject& object) {
                object.number(kSamplesPerPixel, 3).text(kPhotometricInterpretation, "CS", "RGB");
              },
              "in colour"},
        Fault{"Palette",
              [](DicomObject& object) {
                object.text(kPhotometricInterpretation, "CS", "PALETTE COLOR");
              },
              "palette"},
        Fault{"NoPosition", [](DicomObject& object) { object.erase(kImagePosition); },
              "position (0020,0032)"},
        Fault{"PositionOfWords",
              [](DicomObject& object) { object.text(kImagePosition, "DS", "a\\b\\c"); },
              "\"a\\b\\c\""},
        Fault{"PositionNotFinite",
              [](DicomObject& object) { object.text(kImagePosition, "DS", "1\\nan\\2"); },
              "not 3 numbers"},
        Fault{"NoSpacing", [](DicomObject& object) { object.erase(kPixelSpacing); },
              "pixel spacing (0028,0030)"},
        Fault{"ZeroSpacing", [](DicomObject& object) { object.text(kPixelSpacing, "DS", "0\\1"); },
              "not positive"},
        Fault{"LongAxes",
              [](DicomObject& object) { object.text(kImageOrientation, "DS", "2\\0\\0\\0\\1\\0"); },
              "unit vectors"},
        Fault{"SkewAxes",
              [](DicomObject& object) {
                object.text(kImageOrientation, "DS", "1\\0\\0\\0.6\\0.8\\0");
              },
              "perpendicular"},
        Fault{"Table",
              [](DicomObject& object) { object.items(kModalityLutSequence, {DicomObject{}}); },
              "by a lookup table"},
        Fault{"UnplacedFrames",
              [](DicomObject& object) {
                object.text(kNumberOfFrames, "IS", "2").pixels(std::string(80, 'x'), 2);
              },
              "no position for each of them"},
        Fault{"FramesOfWords",
              [](DicomObject& object) { object.text(kNumberOfFrames, "IS", "-1"); }, "\"-1\""}),
    [](const auto& each) { return std::string(each.param.name); });

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
  DicomSeries second;
  second.uid = "1.2.3.9";
  second.slices = 4;
  NamedFiles files = DicomSeries{}.files();
  for (std::uint32_t k = 0; k < second.slices; ++k) {
    files.emplace_back("B" + std::to_string(k),
                       second.slice(k).text(kSeriesDescription, "LO", "scout").file());
  }
  return files;
}

TEST(DicomChoice, IsAskedForWhenThereAreSeveralSeries) {
  const Outcome outcome = import_objects(two_series());
  EXPECT_EQ(outcome.code, ErrorCode::kUnusableVolume);
  EXPECT_THAT(outcome.error, HasSubstr("2 series"));
  EXPECT_THAT(outcome.remedy.choices,
              testing::ElementsAre(Choice{"series", "1.2.3.4", "CT, 6 slices"},
                                   Choice{"series", "1.2.3.9", "scout, CT, 4 slices"}));
}

TEST(DicomChoice, TakesTheSeriesThatIsNamed) {
  const Outcome outcome = import_objects(two_series(), {.series = "1.2.3.9"});
  ASSERT_EQ(outcome.error, "");
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
  DicomSeries other;
  other.uid = "1.9";
  files.emplace_back("report", other.slice(0)
                                   .number(kSamplesPerPixel, 3)
                                   .text(kPhotometricInterpretation, "CS", "RGB")
                                   .file());
  EXPECT_EQ(import_objects(files).remedy.choices.size(), 2);
  EXPECT_EQ(import_objects(files, {.series = "1.2.3.4"}).error, "");
  EXPECT_THAT(import_objects(files, {.series = "1.9"}).error, HasSubstr("in colour"));
}

TEST(DicomIgnored, AreNamedWithTheirReasons) {
  NamedFiles files = DicomSeries{}.files();
  DicomObject report;
  report.text(kModality, "CS", "SR").text(kSeriesInstanceUid, "UI", "1.2.77");
  files.emplace_back("report.dcm", report.file());
  DicomObject directory;
  directory.items(kDirectoryRecordSequence, {});
  files.emplace_back("DICOMDIR", directory.file());
  files.emplace_back("readme.txt", "not DICOM");
  files.emplace_back("empty", "");
  DicomSeries scout;
  scout.along_column = {0, 0, -1};
  files.emplace_back("scout",
                     scout.slice(0).text(kImageType, "CS", "ORIGINAL\\PRIMARY\\LOCALIZER").file());
  const Outcome outcome = import_objects(files);
  ASSERT_EQ(outcome.error, "");
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
