// RT Dose: planes that lie where a vector of offsets says.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/import/dicom/elements/tags.h"
#include "tests/unit/import/dicom/objects.h"

namespace isomesh::import::test {
namespace {

using namespace dicom;
using testing::ElementsAre;
using testing::HasSubstr;

DicomSeries dose_series() {
  return {.slices = 3, .bits_allocated = 32, .bits_stored = 32, .high_bit = 31};
}

DicomObject dose(const DicomSeries& series, const std::string& offsets) {
  DicomObject object = series.slice(0);
  std::string pixels;
  for (std::uint32_t k = 0; k < series.slices; ++k) pixels += series.native_bytes(k);
  object.text(kSopClassUid, "UI", "1.2.840.10008.5.1.4.1.1.481.2")
      .text(kModality, "CS", "RTDOSE")
      .text(kNumberOfFrames, "IS", std::to_string(series.slices))
      .text(kGridFrameOffsetVector, "DS", offsets)
      .text(kDoseGridScaling, "DS", "0.00048828125")
      .pixels(pixels, series.bits_allocated / 8);
  return object;
}

Outcome import_dose(const DicomObject& object) {
  return import_objects({{"dose", object.file(kImplicit)}});
}

TEST(DicomDose, LiesWhereItsOffsetsSay) {
  const DicomSeries series = dose_series();
  const Outcome outcome = imported(import_dose(dose(series, "0\\2.5\\5")));
  EXPECT_THAT(outcome.volume.dims, ElementsAre(5, 4, 3));
  EXPECT_THAT(outcome.volume.geometry.origin, ElementsAre(-10, 20, 30));
  EXPECT_THAT(outcome.volume.geometry.spacing, ElementsAre(0.75, 0.5, 2.5));
  EXPECT_THAT(outcome.volume.geometry.direction, ElementsAre(1, 0, 0, 0, 1, 0, 0, 0, 1));
  EXPECT_EQ(outcome.volume.modality, "RTDOSE");
  ASSERT_EQ(outcome.volume.type, SampleType::kFloat64);
  const auto samples = samples_of<double>(outcome);
  for (std::uint32_t k = 0; k < 3; ++k) {
    EXPECT_EQ(samples[k * 20 + 7], static_cast<double>(series.stored(2, 1, k)) / 2048) << k;
  }
}

// The older way: the patient's z.
TEST(DicomDose, OffsetsMayBePlaces) {
  const std::string relative = import_dose(dose(dose_series(), "0\\2.5\\5")).canonical;
  EXPECT_EQ(import_dose(dose(dose_series(), "30\\32.5\\35")).canonical, relative);
  DicomSeries downward = dose_series();
  downward.along_column = {0, -1, 0};  // so the normal points to the feet
  EXPECT_EQ(import_dose(dose(downward, "30\\27.5\\25")).canonical,
            import_dose(dose(downward, "0\\2.5\\5")).canonical);
}

TEST(DicomDose, OffsetsRunAlongTheNormal) {
  DicomSeries series = dose_series();
  series.along_row = {0, 1, 0};
  series.along_column = {0, 0, -1};
  const Outcome outcome = imported(import_dose(dose(series, "0\\-2\\-4")));
  // row x column is -x; the lattice begins at the last plane, which lies furthest along +x.
  EXPECT_THAT(outcome.volume.geometry.origin, ElementsAre(-6, 20, 30));
  EXPECT_THAT(outcome.volume.geometry.direction, ElementsAre(0, 0, -1, 1, 0, 0, 0, -1, 0));
}

TEST(DicomDose, WithoutPlaceOrScaleIsRefused) {
  const auto error_with = [](const std::string& offsets) {
    return import_dose(dose(dose_series(), offsets)).error;
  };
  EXPECT_THAT(error_with("0\\2.5"), HasSubstr("3 planes, but 2 offsets"));
  EXPECT_THAT(error_with(""), HasSubstr("3 planes, but 0 offsets"));
  EXPECT_THAT(error_with("7\\9.5\\12"), HasSubstr("do not begin with 0"));
  EXPECT_THAT(error_with("0\\2.5\\9"), HasSubstr("slice"));
  DicomSeries oblique = dose_series();
  oblique.along_column = {0, 0.6, 0.8};
  EXPECT_THAT(import_dose(dose(oblique, "30\\32.5\\35")).error, HasSubstr("do not begin with 0"));
  for (const char* scaling : {"", "0", "-1", "x", "1\\2"}) {
    DicomObject object = dose(dose_series(), "0\\2.5\\5");
    object.text(kDoseGridScaling, "DS", scaling);
    EXPECT_THAT(import_dose(object).error, HasSubstr("not a positive number")) << scaling;
  }
}

}  // namespace
}  // namespace isomesh::import::test
