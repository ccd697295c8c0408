// Slices that lie as tiles in one frame.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/import/dicom/elements/csa_header.h"
#include "server/import/dicom/elements/private_elements.h"
#include "server/import/dicom/elements/tags.h"
#include "tests/unit/import/dicom/mosaics.h"

namespace isomesh::import::test {
namespace {

using namespace dicom;
using testing::HasSubstr;

Outcome import_one(const DicomObject& object, std::string_view syntax = kExplicit) {
  return import_objects({{"mosaic", object.file(syntax)}});
}

void expect_slices(const Outcome& outcome, bool reversed = false) {
  ASSERT_EQ(outcome.error, "");
  ASSERT_EQ(outcome.volume.dims, (std::array<std::uint32_t, 3>{kTileColumns, kTileRows, kTiles}));
  const auto samples = samples_of<std::int16_t>(outcome);
  std::size_t at = 0;
  for (std::uint32_t k = 0; k < kTiles; ++k) {
    for (std::uint32_t j = 0; j < kTileRows; ++j) {
      for (std::uint32_t i = 0; i < kTileColumns; ++i) {
        ASSERT_EQ(samples[at++], tile_sample(i, j, reversed ? kTiles - 1 - k : k));
      }
    }
  }
}

using Numbers = std::array<double, 3>;

TEST(DicomMosaic, IsUnfoldedWhereItsFirstTileLies) {
  for (const std::string_view syntax : {kImplicit, kExplicit, kDeflate, kBigEndian}) {
    const Outcome outcome = import_one(siemens_mosaic(), syntax);
    expect_slices(outcome);
    EXPECT_EQ(outcome.volume.geometry.origin, (Numbers{10 + 3 * 3, 20 + 2 * 2, 30}));
    EXPECT_EQ(outcome.volume.geometry.spacing, (Numbers{3, 2, 4.5}));
  }
}

TEST(DicomMosaic, FollowsItsNormalEitherWay) {
  const Outcome outcome = import_one(siemens_mosaic(csa_fields({"0", "0", "-1"})));
  // The stack begins with the last tile, which lies lowest along the image's own normal.
  expect_slices(outcome, true);
  EXPECT_EQ(outcome.volume.geometry.origin, (Numbers{19, 24, 30 - 4 * 4.5}));
  EXPECT_EQ(outcome.volume.geometry.direction[8], 1);
}

TEST(DicomMosaic, HasAHeaderInEitherLayoutAndBlock) {
  expect_slices(import_one(siemens_mosaic(csa_fields({"0", "0", "1"}), false)));
  const DicomObject moved = tiled_object(3, 3)
                                .text(kImageType, "CS", "MOSAIC")
                                .text(kSpacingBetweenSlices, "DS", "4.5")
                                .text(0x00290010, "LO", "SOMEBODY ELSE")
                                .text(0x00290012, "LO", "SIEMENS CSA HEADER")
                                .bytes(0x00291010, "OB", "not the header")
                                .bytes(0x00291210, "OB", csa_header(csa_fields({"0", "0", "1"})));
  expect_slices(import_one(moved));
}

TEST(DicomMosaic, TellsTheNumberInTwoPlaces) {
  CsaFields fields = csa_fields({"0", "0", "1"});
  fields.erase(fields.begin() + 1);
  expect_slices(import_one(
      siemens_mosaic(fields).text(0x00190010, "LO", "SIEMENS MR HEADER").number(kMosaicImages, 5)));
}

TEST(DicomMosaic, IsRefusedWhenItDoesNotSayWhereSlicesLie) {
  EXPECT_THAT(import_one(siemens_mosaic().erase(kCsaImageHeader)).error, HasSubstr("header"));
  EXPECT_THAT(import_one(siemens_mosaic({})).error, HasSubstr("number of slices is unknown"));
  EXPECT_THAT(import_one(siemens_mosaic(csa_fields({}))).error, HasSubstr("SliceNormalVector"));
  EXPECT_THAT(import_one(siemens_mosaic(csa_fields({"0", "1", "0"}))).error, HasSubstr("normal"));
  EXPECT_THAT(import_one(siemens_mosaic(csa_fields({"0", "0", "3"}))).error,
              HasSubstr("unit vectors"));
  EXPECT_THAT(import_one(siemens_mosaic().erase(kSpacingBetweenSlices)).error,
              HasSubstr("the distance between its slices"));
  EXPECT_THAT(
      import_one(
          siemens_mosaic().number(kBitsAllocated, 1).number(kBitsStored, 1).number(kHighBit, 0))
          .error,
      HasSubstr("single bits"));
  CsaFields many = csa_fields({"0", "0", "1"});
  many[1].second = {"17"};
  EXPECT_THAT(import_one(siemens_mosaic(many)).error,
              HasSubstr("cannot be divided into 5 x 5 tiles"));
  many[1].second = {"1e9"};
  EXPECT_THAT(import_one(siemens_mosaic(many)).error, HasSubstr("not a valid number of slices"));
}

TEST(DicomMosaic, TakesTheThicknessWhereNoDistanceIsTold) {
  const Outcome outcome =
      import_one(siemens_mosaic().erase(kSpacingBetweenSlices).text(kSliceThickness, "DS", "4"));
  expect_slices(outcome);
  EXPECT_EQ(outcome.volume.geometry.spacing[2], 4);
  EXPECT_THAT(note_detail(outcome, NoteCode::kDistanceAssumed), HasSubstr("4 mm"));
}

TEST(DicomMosaic, IsUnfoldedByItsProtocol) {
  for (const bool is_reversed : {false, true}) {
    DicomObject object = protocol_mosaic(is_reversed);
    // The creator is what anonymisers remove first.
    for (const bool has_creator : {true, false}) {
      if (!has_creator) object.erase(0x00290010);
      const Outcome outcome = imported(import_one(object));
      EXPECT_EQ(outcome.volume.dims[2], kTiles);
      EXPECT_EQ(outcome.volume.geometry.spacing[2], 4);
      EXPECT_EQ(outcome.volume.geometry.origin[2], is_reversed ? 30 - 16 : 30);
      const auto samples = samples_of<std::int16_t>(outcome);
      EXPECT_EQ(samples[0], tile_sample(0, 0, is_reversed ? kTiles - 1 : 0));
    }
  }
}

TEST(DicomMosaic, IsRefusedIfItsProtocolIsOfOtherSlices) {
  EXPECT_THAT(import_one(protocol_mosaic(false).text(kImagePosition, "DS", "10\\20\\300")).error,
              HasSubstr("neither end"));
  EXPECT_THAT(import_one(protocol_mosaic(false).bytes(
                             kCsaSeriesHeader, "OB",
                             "SV10### ASCCONV BEGIN ###\nsSliceArray.lSize = 1e9\n"))
                  .error,
              HasSubstr("number of slices is unknown"));
}

// Scanners that have unfolded it leave the word.
TEST(DicomMosaic, IsNoneWithFunctionalGroups) {
  const DicomSeries series;
  const DicomObject object =
      series.enhanced({0, 1, 2}).text(kImageType, "CS", "ORIGINAL\\PRIMARY\\M\\MOSAIC");
  const Outcome outcome = imported(import_one(object));
  EXPECT_EQ(outcome.volume.dims[2], 3);
}

TEST(DicomMosaic, IsAVolumeOfItsSeries) {
  NamedFiles files;
  for (int number = 1; number <= 3; ++number) {
    files.emplace_back("M" + std::to_string(number),
                       siemens_mosaic()
                           .text(kInstanceNumber, "IS", std::to_string(number))
                           .text(kAcquisitionTime, "TM", std::to_string(120000 + number))
                           // Corrected for motion: no two lie at the same place.
                           .text(kImagePosition, "DS", "10\\20\\30." + std::to_string(number))
                           .file());
  }
  const Outcome all = import_objects(files);
  EXPECT_THAT(all.error, HasSubstr("3 volumes that differ in AcquisitionTime"));
  ASSERT_EQ(all.remedy.choices.size(), 3);
  EXPECT_EQ(all.remedy.choices[1], (Choice{"volume", "1", "AcquisitionTime 120002, 5 slices"}));
  const Outcome second = import_objects(files, {.volume = 1});
  expect_slices(second);
  EXPECT_EQ(second.volume.geometry.origin[2], 30.2);
  EXPECT_THAT(note_detail(second, NoteCode::kVolumeChosen), HasSubstr("Volume 1 of 3"));
  EXPECT_EQ(second.volume.dicom->instances.size(), 1);
}

TEST(DicomGrid, HasAPlaceForEachSlice) {
  for (const std::string_view syntax : {kImplicit, kExplicit, kBigEndian}) {
    const Outcome outcome = import_one(united_imaging_grid(), syntax);
    expect_slices(outcome, true);
    EXPECT_EQ(outcome.volume.geometry.origin, (Numbers{1, 2, 30 - 16}));
    EXPECT_EQ(outcome.volume.geometry.spacing, (Numbers{3, 2, 4}));
  }
}

// Its slices have positions; the object itself often has none.
TEST(DicomGrid, NeedsNoPositionOfItsOwn) {
  const Outcome outcome = imported(import_one(united_imaging_grid().erase(kImagePosition)));
  EXPECT_EQ(outcome.canonical, import_one(united_imaging_grid()).canonical);
}

TEST(DicomGrid, IsRefusedWhenPlacesAreMissing) {
  EXPECT_THAT(import_one(united_imaging_grid().text(kGridImages, "DS", "6")).error,
              HasSubstr("a grid of 6 slices, but it describes 5"));
  EXPECT_THAT(import_one(united_imaging_grid().items(kGridFrames, {})).error,
              HasSubstr("it describes 0"));
  EXPECT_THAT(
      import_one(united_imaging_grid().items(kGridFrames, std::vector<DicomObject>(kTiles))).error,
      HasSubstr("position"));
}

// The same tags of another maker hold other things.
TEST(DicomGrid, IsKnownByItsMaker) {
  const DicomSeries series;
  const NamedFiles files = changed({.syntax = std::string(kImplicit)}, [](DicomObject& object) {
    object.text(0x00650010, "LO", "SOMEBODY ELSE")
        .text(kGridImages, "DS", "5")
        .text(kGridFrames, "LO", "no sequence");
  });
  EXPECT_EQ(import_objects(files).canonical, import_objects(series.files()).canonical);
}

TEST(CsaHeaderTest, IsReadOrRefusedWhereverItEnds) {
  for (const bool is_newer : {true, false}) {
    const std::string whole = csa_header(csa_fields({"0", "0", "1"}), is_newer);
    const CsaHeader header = parse_csa_header(whole);
    EXPECT_EQ(csa_numbers(header, "NumberOfImagesInMosaic"), std::vector<double>{5});
    EXPECT_EQ(csa_numbers(header, "SliceNormalVector"), (std::vector<double>{0, 0, 1}));
    EXPECT_TRUE(csa_numbers(header, "Nothing").empty());
    for (std::size_t size = 0; size < whole.size(); ++size) {
      EXPECT_THROW(parse_csa_header(whole.substr(0, size)), Error) << size;
    }
  }
}

TEST(CsaHeaderTest, BoundsItsCounts) {
  std::string header = csa_header(csa_fields({"0", "0", "1"}));
  header.replace(8, 4, "\xFF\xFF\xFF\xFF");
  EXPECT_THROW(parse_csa_header(header), Error);
  header = csa_header(csa_fields({"0", "0", "1"}));
  header.replace(16 + 76, 4, "\xFF\xFF\xFF\x7F");
  EXPECT_THROW(parse_csa_header(header), Error);
  // The length of the first value.
  header = csa_header(csa_fields({"0", "0", "1"}));
  header.replace(16 + 84 + 4, 4, "\xFF\xFF\xFF\xFF");
  EXPECT_THROW(parse_csa_header(header), Error);
}

}  // namespace
}  // namespace isomesh::import::test
