// Series of slices that make a volume: order, geometry and values.
#include "server/import/dicom/import.h"

#include <array>
#include <cmath>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/import/dicom/elements/tags.h"
#include "tests/support/deflate.h"
#include "tests/unit/import/archives.h"
#include "tests/unit/import/dicom/objects.h"

namespace isomesh::import::test {
namespace {

using namespace dicom;
using testing::ElementsAre;
using testing::HasSubstr;

// Samples that the series must be imported as. Slices are in order along the normal, as in the
// lattice.
template <class Sample>
std::vector<Sample> expected_samples(const DicomSeries& series, bool from_last = false) {
  std::vector<Sample> samples;
  for (std::uint32_t k = 0; k < series.slices; ++k) {
    const std::uint32_t slice = from_last ? series.slices - 1 - k : k;
    for (std::uint32_t j = 0; j < series.rows; ++j) {
      for (std::uint32_t i = 0; i < series.columns; ++i) {
        samples.push_back(static_cast<Sample>(series.stored(i, j, slice)));
      }
    }
  }
  return samples;
}

TEST(DicomSeriesImport, SortsByPositionAndKeepsGeometry) {
  const DicomSeries series;
  const Outcome outcome = imported(import_objects(series.files()));
  const Volume& volume = outcome.volume;
  EXPECT_EQ(volume.format, "dicom");
  EXPECT_THAT(volume.dims, ElementsAre(5, 4, 6));
  EXPECT_EQ(volume.type, SampleType::kUint16);
  // Pixel spacing is told as the distance between rows first.
  EXPECT_THAT(volume.geometry.spacing, ElementsAre(0.75, 0.5, 2.5));
  EXPECT_THAT(volume.geometry.origin, ElementsAre(-10, 20, 30));
  EXPECT_THAT(volume.geometry.direction, ElementsAre(1, 0, 0, 0, 1, 0, 0, 0, 1));
  EXPECT_EQ(samples_of<std::uint16_t>(outcome), expected_samples<std::uint16_t>(series));
  EXPECT_EQ(volume.bytes, 5 * 4 * 6 * 2);
  EXPECT_EQ(volume.modality, "CT");
  EXPECT_TRUE(volume.ignored.empty());
}

TEST(DicomSeriesImport, NeedsNoPreambleAndNoMetaInformation) {
  constexpr std::size_t kPreambleBytes = 132;
  const DicomSeries series;
  const std::string expected = import_objects(series.files()).canonical;
  for (const std::string_view syntax : {kExplicit, kImplicit, kBigEndian, kDeflate}) {
    NamedFiles alone;
    NamedFiles with_meta;
    for (std::uint32_t k = 0; k < series.slices; ++k) {
      const DicomObject slice = series.slice(k);
      alone.emplace_back(std::to_string(k), slice.bare(syntax));
      with_meta.emplace_back(std::to_string(k), slice.file(syntax).substr(kPreambleBytes));
    }
    EXPECT_EQ(imported(import_objects(with_meta)).canonical, expected) << syntax;
    // Without meta information only these two can be told.
    if (syntax != kExplicit && syntax != kImplicit) continue;
    EXPECT_EQ(imported(import_objects(alone)).canonical, expected) << syntax;
  }
}

TEST(DicomSeriesImport, SlicesMayBeGzipped) {
  const DicomSeries series;
  const std::string expected = import_objects(series.files()).canonical;
  for (const std::string_view syntax : {kExplicit, kDeflate}) {
    bool is_gzipped = false;
    std::vector<Member> members;
    for (std::uint32_t k = 0; k < series.slices; ++k) {
      const std::string file = series.slice(k).file(syntax);
      members.push_back({std::to_string(k), is_gzipped ? isomesh::test::gzip(file) : file});
      is_gzipped = !is_gzipped;
    }
    const Outcome outcome = import_bytes(zip(members));
    EXPECT_EQ(outcome.error, "") << syntax;
    EXPECT_EQ(outcome.canonical, expected) << syntax;
    EXPECT_TRUE(outcome.volume.ignored.empty()) << syntax;
  }
}

TEST(DicomSeriesImport, RunsAlongTheNormalWhateverTheScannersOrder) {
  DicomSeries series;
  series.step = {0, 0, -2.5};
  const Outcome outcome = imported(import_objects(series.files()));
  EXPECT_THAT(outcome.volume.geometry.origin, ElementsAre(-10, 20, 17.5));
  EXPECT_THAT(outcome.volume.geometry.direction, ElementsAre(1, 0, 0, 0, 1, 0, 0, 0, 1));
  EXPECT_EQ(samples_of<std::uint16_t>(outcome), expected_samples<std::uint16_t>(series, true));
}

TEST(DicomSeriesImport, KeepsObliqueAxes) {
  DicomSeries series;
  series.along_row = {0.6, 0.8, 0};
  series.along_column = {0, 0, -1};
  series.step = {-0.8 * 3, 0.6 * 3, 0};  // row x column
  const Outcome outcome = imported(import_objects(series.files()));
  const auto& direction = outcome.volume.geometry.direction;
  const std::array<double, 9> expected = {0.6, 0, -0.8, 0.8, 0, 0.6, 0, -1, 0};
  for (std::size_t i = 0; i < 9; ++i) EXPECT_NEAR(direction[i], expected[i], 1e-12) << i;
  EXPECT_NEAR(outcome.volume.geometry.spacing[2], 3, 1e-12);
}

TEST(DicomSeriesImport, ShearsTheLatticeOfATiltedGantry) {
  DicomSeries series;
  const double tilt = 20 * std::numbers::pi / 180;
  series.along_column = {0, std::cos(tilt), -std::sin(tilt)};
  series.step = {0, 0, 5};  // the table moves along z, not along the slices' normal
  const Outcome outcome = imported(import_objects(series.files()));
  const Geometry& geometry = outcome.volume.geometry;
  EXPECT_NEAR(geometry.spacing[2], 5, 1e-10);
  EXPECT_NEAR(geometry.direction[2], 0, 1e-10);
  EXPECT_NEAR(geometry.direction[5], 0, 1e-10);
  EXPECT_NEAR(geometry.direction[8], 1, 1e-10);
  EXPECT_NEAR(geometry.direction[4], std::cos(tilt), 1e-7);
  EXPECT_EQ(samples_of<std::uint16_t>(outcome), expected_samples<std::uint16_t>(series));
  // Every slice begins where its own header says.
  for (std::uint32_t k = 0; k < series.slices; ++k) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(geometry.origin[axis] + step_of(geometry, 2)[axis] * k, series.position(k)[axis],
                  1e-9);
    }
  }
}

TEST(DicomSeriesImport, ToleratesRoundedPositions) {
  const DicomSeries series = {.step = {0, 0, 0.625}};
  const Outcome outcome =
      imported(import_objects(changed(series, [&](DicomObject& object, std::uint32_t k) {
        const double rounded = std::round(series.position(k)[2] * 100) / 100;
        object.text(kImagePosition, "DS", "-10\\20\\" + std::to_string(rounded));
      })));
  EXPECT_NEAR(outcome.volume.geometry.spacing[2], 0.625, 0.01);
}

// --- Values --------------------------------------------------------------------------------------

// With slopes and intercepts that take turns.
Outcome import_scaled(const DicomSeries& series,
                      const std::vector<std::pair<std::string, std::string>>& scales) {
  return import_objects(changed(series, [&](DicomObject& object, std::uint32_t k) {
    const auto& [slope, intercept] = scales[k % scales.size()];
    object.text(kRescaleSlope, "DS", slope).text(kRescaleIntercept, "DS", intercept);
  }));
}

TEST(DicomValues, StayIntegersWhereTheyCan) {
  DicomSeries series;
  const Outcome outcome = imported(import_scaled(series, {{"1", "-1024"}}));
  EXPECT_EQ(outcome.volume.type, SampleType::kInt16);
  const auto samples = samples_of<std::int16_t>(outcome);
  const auto stored = expected_samples<std::int16_t>(series);
  for (std::size_t i = 0; i < samples.size(); ++i) ASSERT_EQ(samples[i], stored[i] - 1024);
}

TEST(DicomValues, AreWidenedOnlyWhenTheyMustBe) {
  DicomSeries series;
  series.bits_stored = 16;
  series.high_bit = 15;
  const Outcome wide = imported(import_scaled(series, {{"1", "-1024"}}));
  EXPECT_EQ(wide.volume.type, SampleType::kInt32);
  EXPECT_EQ(samples_of<std::int32_t>(wide)[0], series.stored(0, 0, 0) - 1024);

  // The actual values of a 16-bit CT fit, although the full 16-bit range would not.
  NamedFiles files = changed(series, [&](DicomObject& object) {
    object.text(kRescaleSlope, "DS", "1").text(kRescaleIntercept, "DS", "-1024");
    std::string pixels;
    for (int i = 0; i < 20; ++i) pixels += std::string(1, static_cast<char>(i)) + '\x0c';
    object.pixels(pixels, 2);
  });
  const Outcome narrow = imported(import_objects(files));
  EXPECT_EQ(narrow.volume.type, SampleType::kInt16);
  EXPECT_EQ(samples_of<std::int16_t>(narrow)[5], 0x0c05 - 1024);
}

TEST(DicomValues, AreScaledSliceBySlice) {
  const DicomSeries series;
  const Outcome outcome = imported(import_scaled(series, {{"0.5", "1.25"}, {"2", "-3"}}));
  EXPECT_EQ(outcome.volume.type, SampleType::kFloat32);
  const auto samples = samples_of<float>(outcome);
  const auto stored = expected_samples<float>(series);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const bool even = i / 20 % 2 == 0;
    ASSERT_EQ(samples[i], even ? stored[i] * 0.5F + 1.25F : stored[i] * 2 - 3);
  }
}

TEST(DicomValues, StayDifferentBesideALargeIntercept) {
  const DicomSeries series;
  const Outcome outcome = imported(import_scaled(series, {{"0.5", "10000000"}}));
  ASSERT_EQ(outcome.volume.type, SampleType::kFloat64);
  const auto samples = samples_of<double>(outcome);
  const auto stored = expected_samples<double>(series);
  for (std::size_t i = 0; i < samples.size(); ++i) ASSERT_EQ(samples[i], stored[i] * 0.5 + 1e7);
  EXPECT_EQ(import_scaled(series, {{"0.5", "4000000.5"}}).volume.type, SampleType::kFloat32);
}

TEST(DicomValues, WithoutAMeaningAreRefused) {
  const DicomSeries series;
  for (const auto& [slope, intercept] :
       {std::pair{"0", "0"}, std::pair{"nan", "0"}, std::pair{"1", "x"}, std::pair{"1e999", "0"}}) {
    EXPECT_THAT(import_scaled(series, {{slope, intercept}}).error, HasSubstr("rescale slope"))
        << slope;
  }
}

TEST(DicomValues, AreScaledByWhatIsTold) {
  const DicomSeries series;
  const auto first_of = [&](const char* slope, const char* intercept) {
    const Outcome outcome = imported(import_scaled(series, {{slope, intercept}}));
    return samples_of<std::int16_t>(outcome)[0];
  };
  EXPECT_EQ(first_of("3", ""), series.stored(0, 0, 0) * 3);
  EXPECT_EQ(first_of("", "-5"), series.stored(0, 0, 0) - 5);
}

TEST(DicomValues, AreCutOutOfTheirBits) {
  DicomSeries series;
  series.bits_stored = 10;
  series.high_bit = 13;
  series.is_signed = true;
  // Bits beside the stored ones are of overlays, and no part of the samples.
  const Outcome outcome = imported(import_objects(changed(series, [&](DicomObject& object) {
    std::string pixels = series.native_bytes(2);
    for (std::size_t i = 0; i < pixels.size(); i += 2) {
      pixels[i] = static_cast<char>(pixels[i] | 0x0f);
      pixels[i + 1] = static_cast<char>(pixels[i + 1] | '\xc0');
    }
    object.pixels(pixels, 2);
  })));
  EXPECT_EQ(outcome.volume.type, SampleType::kInt16);
  const auto samples = samples_of<std::int16_t>(outcome);
  for (std::uint32_t i = 0; i < 20; ++i) ASSERT_EQ(samples[i], series.stored(i % 5, i / 5, 2));
  EXPECT_LT(outcome.volume.range[0], 0);
}

TEST(DicomValues, OfMonochrome1AreKeptAsTheyAreStored) {
  const DicomSeries series;
  const Outcome outcome = imported(import_objects(changed(series, [](DicomObject& object) {
    object.text(kPhotometricInterpretation, "CS", "MONOCHROME1");
  })));
  EXPECT_EQ(samples_of<std::uint16_t>(outcome), expected_samples<std::uint16_t>(series));
}

// --- What a person is told -----------------------------------------------------------------------

TEST(DicomPresets, AreThoseOfACtInHounsfieldUnits) {
  const DicomSeries series;
  const Outcome outcome = import_scaled(series, {{"1", "-1024"}});
  ASSERT_EQ(outcome.volume.presets.size(), 3);
  EXPECT_EQ(outcome.volume.presets[0], (Preset{"skin", -300}));
  EXPECT_EQ(outcome.volume.presets[2], (Preset{"bone", 250}));
  const auto none = [&](Tag tag, std::string_view value) {
    return import_objects(
               changed(
                   series,
                   [&](DicomObject& object) {
                     object.text(kRescaleSlope, "DS", "1").text(kRescaleIntercept, "DS", "-1024");
                     object.text(tag, "LO", value);
                   }))
        .volume.presets.empty();
  };
  EXPECT_TRUE(none(kModality, "MR"));
  EXPECT_TRUE(none(kRescaleType, "US"));
  EXPECT_FALSE(none(kRescaleType, "HU"));
}

TEST(DicomPresets, LieWithinTheSamples) {
  const DicomSeries series;  // 0 to 4095
  const Outcome outcome = import_scaled(series, {{"1", "0"}});
  ASSERT_EQ(outcome.volume.presets.size(), 1);
  EXPECT_EQ(outcome.volume.presets[0].name, "bone");
}

TEST(DicomPresets, AreNotOfACtWithoutARescale) {
  const DicomSeries series;  // 0 to 4095
  const Outcome outcome = import_objects(series.files());
  EXPECT_EQ(outcome.volume.modality, "CT");
  EXPECT_TRUE(outcome.volume.presets.empty());
}

TEST(DicomIdentityImport, IsKeptInUtf8) {
  const DicomSeries series;
  const Outcome outcome = imported(import_objects(changed(series, [](DicomObject& object) {
    object.text(kSpecificCharacterSet, "CS", "ISO_IR 100")
        .text(kPatientName, "PN", "M\xfcller^Eva")
        .text(kPatientId, "LO", "4711")
        .text(kStudyInstanceUid, "UI", "1.2.3")
        .text(kSeriesDescription, "LO", "axial \xe0 1 mm");
  })));
  ASSERT_TRUE(outcome.volume.dicom);
  const DicomIdentity& identity = *outcome.volume.dicom;
  EXPECT_EQ(identity.patient_name, "Müller^Eva");
  EXPECT_EQ(identity.patient_id, "4711");
  EXPECT_EQ(identity.study_uid, "1.2.3");
  EXPECT_EQ(identity.series_uid, "1.2.3.4");
  EXPECT_EQ(identity.series_description, "axial à 1 mm");
  ASSERT_EQ(identity.instances.size(), 6);
  for (std::size_t k = 0; k < 6; ++k) {
    EXPECT_EQ(identity.instances[k].sop_class_uid, "1.2.840.10008.5.1.4.1.1.2");
    EXPECT_EQ(identity.instances[k].sop_instance_uid, "1.2.3.4." + std::to_string(k + 1));
  }
}

TEST(DicomIdentityImport, IsNoPartOfTheCanonicalFile) {
  const DicomSeries series;
  const Outcome known = import_objects(changed(
      series, [](DicomObject& object) { object.text(kPatientName, "PN", "Somebody^Known"); }));
  EXPECT_EQ(known.canonical, import_objects(series.files()).canonical);
  EXPECT_EQ(known.canonical.find("Somebody"), std::string::npos);
}

// --- All of it at once ---------------------------------------------------------------------------

TEST(DicomSeriesImport, GivesRandomSeriesBackExactly) {
  std::mt19937 random(20);
  const auto pick = [&](int low, int high) {
    return std::uniform_int_distribution<int>(low, high)(random);
  };
  const std::array<std::string_view, 4> syntaxes = {kImplicit, kExplicit, kDeflate, kBigEndian};
  for (int round = 0; round < 150; ++round) {
    DicomSeries series;
    series.columns = static_cast<unsigned>(pick(2, 9));
    series.rows = static_cast<unsigned>(pick(2, 9));
    series.slices = static_cast<unsigned>(pick(2, 20));
    series.bits_allocated = 8U << pick(0, 2);
    series.bits_stored = static_cast<unsigned>(pick(1, static_cast<int>(series.bits_allocated)));
    series.high_bit = static_cast<unsigned>(pick(static_cast<int>(series.bits_stored) - 1,
                                                 static_cast<int>(series.bits_allocated) - 1));
    series.is_signed = pick(0, 1) == 1;
    series.syntax = syntaxes[static_cast<std::size_t>(pick(0, 3))];
    series.step = {0.1 * pick(-9, 9), 0.1 * pick(-9, 9), 0.1 * pick(5, 40)};
    if (series.bits_allocated == 8 && series.columns * series.rows % 2 != 0) series.columns *= 2;
    const Outcome outcome = import_objects(series.files());
    ASSERT_EQ(outcome.error, "") << "round " << round;
    std::vector<double> samples;
    with_sample(outcome.volume.type, [&](auto sample) {
      for (const auto each : samples_of<decltype(sample)>(outcome)) {
        samples.push_back(static_cast<double>(each));
      }
    });
    ASSERT_EQ(samples, expected_samples<double>(series)) << "round " << round;
    ASSERT_EQ(bytes_per_sample(outcome.volume.type), series.bits_allocated / 8);
  }
}

}  // namespace
}  // namespace isomesh::import::test
