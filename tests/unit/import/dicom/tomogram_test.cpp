// Tomograms of nuclear medicine, ultrasound volumes, and samples with a table of values.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/import/dicom/elements/tags.h"
#include "tests/unit/import/dicom/objects.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using namespace dicom;
using testing::ElementsAre;
using testing::HasSubstr;

std::string words(const std::vector<std::uint16_t>& values) { return bytes_of(values); }

// Three slices, the first at (1, 2, 30), each further one 4 mm against the normal.
DicomObject tomogram(std::uint32_t frames = 3) {
  const DicomSeries series;
  std::string pixels;
  for (std::uint32_t k = 0; k < frames; ++k) pixels += series.native_bytes(k);
  return series.slice(0)
      .text(kSopClassUid, "UI", "1.2.840.10008.5.1.4.1.1.20")
      .text(kModality, "CS", "NM")
      .text(kImageType, "CS", "ORIGINAL\\PRIMARY\\RECON TOMO\\EMISSION")
      .text(kNumberOfFrames, "IS", std::to_string(frames))
      .text(kSpacingBetweenSlices, "DS", "-4")
      .erase(kImagePosition)
      .erase(kImageOrientation)
      .items(kDetectorInformationSequence, {DicomObject()
                                                .text(kImagePosition, "DS", "1\\2\\30")
                                                .text(kImageOrientation, "DS", "1\\0\\0\\0\\1\\0")})
      .pixels(pixels, 2);
}

Outcome import_one(const DicomObject& object, const ImportOptions& options = {}) {
  return import_objects({{"one", object.file(kImplicit)}}, options);
}

TEST(DicomTomogram, LiesWhereItsDetectorSays) {
  const Outcome outcome = imported(import_one(tomogram()));
  EXPECT_THAT(outcome.volume.dims, ElementsAre(5, 4, 3));
  EXPECT_THAT(outcome.volume.geometry.origin, ElementsAre(1, 2, 30 - 8));
  EXPECT_THAT(outcome.volume.geometry.spacing, ElementsAre(0.75, 0.5, 4));
  const DicomSeries series;
  EXPECT_EQ(samples_of<std::int16_t>(outcome)[0], series.stored(0, 0, 2));
  EXPECT_EQ(samples_of<std::int16_t>(outcome)[40], series.stored(0, 0, 0));
}

TEST(DicomTomogram, WithoutAPlaceIsReadIfTheRequestAcceptsIt) {
  const DicomObject object = tomogram().erase(kDetectorInformationSequence);
  const Outcome refused = import_one(object);
  EXPECT_THAT(refused.error, HasSubstr("accept=space-assumed"));
  EXPECT_EQ(refused.remedy.overridable, "space-assumed");
  const Outcome outcome = imported(import_one(object, {.accept = {"space-assumed"}}));
  EXPECT_THAT(outcome.volume.geometry.origin, ElementsAre(0, 0, -8));
  EXPECT_THAT(note_detail(outcome, NoteCode::kSpaceAssumed), HasSubstr("at the origin"));
}

TEST(DicomTomogram, HasAVolumeForEachTimeSlot) {
  DicomObject object = tomogram(6);
  object.bytes(kSliceVector, "US", words({1, 2, 3, 1, 2, 3}))
      .bytes(kTimeSlotVector, "US", words({1, 1, 1, 2, 2, 2}));
  const Outcome all = import_one(object);
  EXPECT_THAT(all.remedy.choices, ElementsAre(Choice{"volume", "0", "TimeSlotVector 1, 3 slices"},
                                              Choice{"volume", "1", "TimeSlotVector 2, 3 slices"}));
  const DicomSeries series;
  EXPECT_EQ(samples_of<std::int16_t>(import_one(object, {.volume = 1}))[0], series.stored(0, 0, 5));
}

TEST(DicomTomogram, IsRefusedIfItsFramesAreNoSlices) {
  DicomObject object = tomogram();
  EXPECT_THAT(import_one(object.text(kImageType, "CS", "ORIGINAL\\PRIMARY\\TOMO\\EMISSION")).error,
              HasSubstr("projections"));
  EXPECT_THAT(import_one(tomogram().bytes(kSliceVector, "US", words({1, 2}))).error,
              HasSubstr("3 frames, but 2 slice numbers"));
  const Outcome thick =
      import_one(tomogram().erase(kSpacingBetweenSlices).text(kSliceThickness, "DS", "5"));
  EXPECT_EQ(thick.volume.geometry.spacing[2], 5);
  EXPECT_THAT(note_detail(thick, NoteCode::kDistanceAssumed), HasSubstr("5 mm"));
}

TEST(DicomTomogram, WithoutADistanceGetsThatOfTheRequest) {
  const DicomObject object = tomogram().erase(kSpacingBetweenSlices);
  const Outcome refused = import_one(object);
  EXPECT_THAT(refused.error, HasSubstr("distance between its slices (0018,0088)"));
  EXPECT_THAT(refused.remedy.choices,
              ElementsAre(Choice{"spacing", "0.75,0.5,1", "a distance of 1 mm"}));
  const Outcome outcome = imported(import_one(object, {.spacing = std::array<double, 3>{9, 9, 3}}));
  EXPECT_THAT(outcome.volume.geometry.spacing, ElementsAre(0.75, 0.5, 3));
  EXPECT_THAT(outcome.volume.geometry.origin, ElementsAre(1, 2, 30));
  EXPECT_THAT(codes_of(outcome), testing::IsEmpty());
  EXPECT_THAT(import_one(tomogram(), {.spacing = std::array<double, 3>{9, 9, 3}}).error,
              HasSubstr("spacing"));
}

// PS3.3, A.59: positions in the space of the volume, as binary numbers.
TEST(DicomUltrasound, IsReadInItsOwnSpace) {
  const DicomSeries series;
  DicomObject object = series.enhanced({0, 1, 2});
  std::vector<DicomObject> frames;
  for (int k = 0; k < 3; ++k) {
    frames.push_back(
        DicomObject().items(kPlanePositionVolumeSequence,
                            {DicomObject().bytes(kImagePositionVolume, "FD",
                                                 bytes_of(std::vector<double>{1, 2, 3.0 + k}))}));
  }
  DicomObject shared;
  shared
      .items(kPlaneOrientationVolumeSequence,
             {DicomObject().bytes(kImageOrientationVolume, "FD",
                                  bytes_of(std::vector<double>{1, 0, 0, 0, 1, 0}))})
      .items(kPixelMeasuresSequence, {DicomObject().text(kPixelSpacing, "DS", "0.5\\0.75")});
  object.text(kModality, "CS", "US")
      .items(kSharedFunctionalGroups, {shared})
      .items(kPerFrameFunctionalGroups, frames);
  const Outcome outcome = imported(import_one(object));
  EXPECT_THAT(outcome.volume.geometry.origin, ElementsAre(1, 2, 3));
  EXPECT_THAT(outcome.volume.geometry.spacing, ElementsAre(0.75, 0.5, 1));
  EXPECT_THAT(note_detail(outcome, NoteCode::kSpaceAssumed), HasSubstr("transducer"));
}

// Two entries, for the stored values 2 and 3; others have the value of the nearer one.
TEST(DicomTable, GivesSamplesTheirValues) {
  std::string pixels(20, '\1');
  pixels[1] = 3;
  pixels[2] = 9;
  const DicomSeries series = {.bits_allocated = 8, .bits_stored = 8, .high_bit = 7};
  const Outcome outcome = imported(import_objects(changed(series, [&](DicomObject& object) {
    object.pixels(pixels, 1).items(kModalityLutSequence,
                                   {DicomObject()
                                        .numbers(kLutDescriptor, {2, 2, 16})
                                        .text(kModalityLutType, "LO", "HU")
                                        .bytes(kLutData, "OW", words({1000, 40000}))});
  })));
  EXPECT_EQ(outcome.volume.type, SampleType::kUint16);
  const auto samples = samples_of<std::uint16_t>(outcome);
  EXPECT_EQ(samples[0], 1000);
  EXPECT_EQ(samples[1], 40000);
  EXPECT_EQ(samples[2], 40000);
}

TEST(DicomTable, OfTooFewEntriesIsRefused) {
  DicomObject object = DicomSeries{}.slice(0);
  object.items(
      kModalityLutSequence,
      {DicomObject().numbers(kLutDescriptor, {0, 0, 16}).bytes(kLutData, "OW", words({1, 2}))});
  EXPECT_THAT(import_one(object).error, HasSubstr("4 bytes for 65536 entries"));
}

}  // namespace
}  // namespace isomesh::import::test
