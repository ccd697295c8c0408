// Stored values that are no part of an image.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/import/dicom/elements/tags.h"
#include "tests/unit/import/dicom/objects.h"

namespace isomesh::import::test {
namespace {

using namespace dicom;
using testing::HasSubstr;

constexpr int kPad = -3024;
const DicomSeries kSeries = {.columns = 8,
                             .rows = 6,
                             .slices = 4,
                             .bits_allocated = 16,
                             .bits_stored = 16,
                             .high_bit = 15,
                             .is_signed = true};
constexpr std::size_t kSamples = std::size_t{8} * 6 * 4;

// The first two columns are padding. The others have two kinds of tissue, with noise.
bool is_padded(std::uint32_t i) { return i < 2; }

int image_value(std::uint32_t i, std::uint32_t j, std::uint32_t k) {
  return (i + j < 7 ? -1000 : 40) + static_cast<int>((i * 7 + j * 3 + k * 5) % 11);
}

constexpr double kLeast = -1000;

std::string word(int value) {
  return {static_cast<char>(value & 0xFF), static_cast<char>(value >> 8 & 0xFF)};
}

using Stored = std::function<int(std::uint32_t i, std::uint32_t j, std::uint32_t k)>;

Stored padded(int padding) {
  return [=](std::uint32_t i, std::uint32_t j, std::uint32_t k) {
    return is_padded(i) ? padding : image_value(i, j, k);
  };
}

std::string plane_of(const Stored& stored, std::uint32_t k) {
  std::string bytes;
  for (std::uint32_t j = 0; j < kSeries.rows; ++j) {
    for (std::uint32_t i = 0; i < kSeries.columns; ++i) bytes += word(stored(i, j, k));
  }
  return bytes;
}

using Change = std::function<void(DicomObject&, std::uint32_t slice)>;

NamedFiles files_of(const Stored& stored, const Change& change,
                    const DicomSeries& series = kSeries) {
  return changed(series, [&](DicomObject& object, std::uint32_t k) {
    object.pixels(plane_of(stored, k), 2);
    change(object, k);
  });
}

Change with_padding(int value, std::string_view vr = "SS") {
  return [=](DicomObject& object, std::uint32_t) {
    object.bytes(kPixelPaddingValue, vr, word(value));
  };
}

// Checks that padding has the smallest real value, and all else its own.
void expect_left_out(const Outcome& outcome, const std::string& what = {}) {
  ASSERT_EQ(outcome.error, "") << what;
  const auto samples = samples_of<std::int16_t>(outcome);
  ASSERT_EQ(samples.size(), kSamples) << what;
  for (std::uint32_t at = 0; at < samples.size(); ++at) {
    const std::uint32_t i = at % 8;
    const int expected =
        is_padded(i) ? static_cast<int>(kLeast) : image_value(i, at / 8 % 6, at / 48);
    ASSERT_EQ(samples[at], expected) << what << ' ' << at;
  }
  EXPECT_EQ(outcome.volume.range, (std::array<double, 2>{kLeast, 50})) << what;
  EXPECT_EQ(note_detail(outcome, NoteCode::kPadding),
            "48 of the 192 samples have the padding value of the file. At iso-values above the "
            "smallest sample they lie outside the surface, or inside it with inside=below.")
      << what;
  // Midway between -990, the last of one class, and 40, the first of the other.
  EXPECT_EQ(outcome.volume.suggested_iso, -475) << what;
}

TEST(DicomPadding, IsOutside) {
  expect_left_out(import_objects(files_of(padded(kPad), with_padding(kPad))));
  // High values are outside, too.
  expect_left_out(import_objects(files_of(padded(32767), with_padding(32767))));
  // It does not depend on the display.
  expect_left_out(
      import_objects(files_of(padded(kPad), [](DicomObject& object, std::uint32_t slice) {
        with_padding(kPad)(object, slice);
        object.text(kPhotometricInterpretation, "CS", "MONOCHROME1");
      })));
}

TEST(DicomPadding, IsASampleWhereTheHeaderDoesNotTellOrTheRequestAcceptsIt) {
  const auto nothing = [](DicomObject&, std::uint32_t) {};
  const Outcome untold = imported(import_objects(files_of(padded(kPad), nothing)));
  EXPECT_EQ(untold.volume.range[0], kPad);
  EXPECT_EQ(note_detail(untold, NoteCode::kPadding), "");
  const Outcome accepted =
      imported(import_objects(files_of(padded(kPad), with_padding(kPad)), {.accept = {"padding"}}));
  EXPECT_EQ(accepted.canonical, untold.canonical);
  EXPECT_EQ(accepted.volume.suggested_iso, untold.volume.suggested_iso);
  EXPECT_THAT(note_detail(accepted, NoteCode::kPadding), HasSubstr("The request accepts padding"));
  // No sample has this value.
  const Outcome other = imported(import_objects(files_of(padded(kPad), with_padding(-2000))));
  EXPECT_EQ(other.canonical, untold.canonical);
  EXPECT_EQ(note_detail(other, NoteCode::kPadding), "");
}

TEST(DicomPadding, HasTheSignOfTheSamples) {
  for (const std::string_view syntax : {kExplicit, kImplicit, kBigEndian}) {
    DicomSeries series = kSeries;
    series.syntax = syntax;
    const auto change = [&](DicomObject& object, std::uint32_t) {
      const std::string bytes = word(kPad);
      const bool is_big = syntax == kBigEndian;
      object.bytes(kPixelPaddingValue, "US",
                   is_big ? std::string(bytes.rbegin(), bytes.rend()) : bytes);
    };
    expect_left_out(import_objects(files_of(padded(kPad), change, series)), std::string(syntax));
  }
  // A negative value for unsigned samples, as signed words: 62512 is meant.
  DicomSeries series = kSeries;
  series.is_signed = false;
  const auto stored = [](std::uint32_t i, std::uint32_t j, std::uint32_t k) {
    return is_padded(i) ? 62512 : image_value(i, j, k) + 1024;
  };
  const auto change = [](DicomObject& object, std::uint32_t slice) {
    with_padding(kPad)(object, slice);
    object.text(kRescaleIntercept, "DS", "-1024").text(kRescaleSlope, "DS", "1");
  };
  const Outcome outcome = imported(import_objects(files_of(stored, change, series)));
  EXPECT_EQ(outcome.volume.range, (std::array<double, 2>{kLeast, 50}));
  EXPECT_EQ(outcome.volume.suggested_iso, -475);
}

// Twelve bits, and a value of 16 that would be 2096 in twelve.
TEST(DicomPadding, MayHaveMoreBitsThanSamples) {
  DicomSeries series = kSeries;
  series.is_signed = false;
  series.bits_stored = 12;
  series.high_bit = 11;
  const auto stored = [](std::uint32_t i, std::uint32_t j, std::uint32_t k) {
    return is_padded(i) ? -2000 : i == 7 ? 2096 : image_value(i, j, k) + 1024;
  };
  const Outcome outcome = imported(import_objects(files_of(stored, with_padding(-2000), series)));
  const auto samples = samples_of<std::uint16_t>(outcome);
  EXPECT_EQ(outcome.volume.range, (std::array<double, 2>{24, 2096}));
  EXPECT_EQ(samples[0], 24);
  EXPECT_EQ(samples[7], 2096);
  EXPECT_THAT(note_detail(outcome, NoteCode::kPadding), HasSubstr("48 of the 192"));
}

TEST(DicomPadding, MayBeARange) {
  for (const auto& [value, limit] : {std::pair(-3024, -2000), std::pair(-2000, -3024)}) {
    const auto stored = [](std::uint32_t i, std::uint32_t j, std::uint32_t k) {
      return is_padded(i) ? -3024 + static_cast<int>(k) * 300 : image_value(i, j, k);
    };
    // Clang 14 does not capture what a structured binding names.
    const auto change = [value = value, limit = limit](DicomObject& object, std::uint32_t slice) {
      with_padding(value)(object, slice);
      object.bytes(kPixelPaddingRangeLimit, "SS", word(limit));
    };
    expect_left_out(import_objects(files_of(stored, change)), std::to_string(value));
  }
}

// The value is stored, so slope and intercept do not apply to it.
TEST(DicomPadding, OfEachSliceIsItsOwn) {
  const auto stored = [](std::uint32_t i, std::uint32_t j, std::uint32_t k) {
    const int shift = static_cast<int>(k) * 100;
    return is_padded(i) ? kPad - static_cast<int>(k) : image_value(i, j, k) + shift;
  };
  const auto change = [](DicomObject& object, std::uint32_t k) {
    with_padding(kPad - static_cast<int>(k))(object, k);
    object.text(kRescaleIntercept, "DS", std::to_string(static_cast<int>(k) * -100))
        .text(kRescaleSlope, "DS", "1");
  };
  expect_left_out(import_objects(files_of(stored, change)));
}

TEST(DicomPadding, IsThatBeforeALookupTable) {
  // The table maps 0..2 to 100, 500 and 900; 7, the padding, would be 900, too.
  DicomSeries series = kSeries;
  series.is_signed = false;
  const auto stored = [](std::uint32_t i, std::uint32_t j, std::uint32_t) {
    return is_padded(i) ? 7 : static_cast<int>((i + j) % 3);
  };
  const auto change = [](DicomObject& object, std::uint32_t slice) {
    with_padding(7, "US")(object, slice);
    object.items(
        kModalityLutSequence,
        {DicomObject().numbers(kLutDescriptor, {3, 0, 16}).numbers(kLutData, {100, 500, 900})});
  };
  const Outcome outcome = imported(import_objects(files_of(stored, change, series)));
  const auto samples = samples_of<std::uint16_t>(outcome);
  EXPECT_EQ(samples[0], 100);
  EXPECT_EQ(samples[2], 900);
  EXPECT_EQ(outcome.volume.range, (std::array<double, 2>{100, 900}));
}

TEST(DicomPadding, IsThatOfTheWholeObject) {
  DicomObject object = kSeries.enhanced({0, 1, 2, 3});
  std::string pixels;
  for (std::uint32_t k = 0; k < 4; ++k) pixels += plane_of(padded(kPad), k);
  object.pixels(pixels, 2).bytes(kPixelPaddingValue, "SS", word(kPad));
  expect_left_out(import_objects({{"frames", object.file()}}));
}

// Larger and smoother than the others, because GDCM writes beyond its buffer otherwise.
TEST(DicomPadding, MayBeCompressed) {
  DicomSeries series = kSeries;
  series.columns = 32;
  series.rows = 24;
  std::string plane;
  for (int at = 0; at < 32 * 24; ++at) plane += word(at % 32 < 16 ? kPad : at % 32 * 4);
  const auto padded_plane = [&](DicomObject& object, std::uint32_t slice) {
    with_padding(kPad)(object, slice);
    object.pixels(plane, 2);
  };
  const Outcome plain = imported(import_objects(changed(series, padded_plane)));
  EXPECT_EQ(plain.volume.range, (std::array<double, 2>{64, 124}));
  for (const std::string_view syntax : {"1.2.840.10008.1.2.4.70", "1.2.840.10008.1.2.4.90"}) {
    series.syntax = syntax;
    const auto packed_plane = [&](DicomObject& object, std::uint32_t slice) {
      with_padding(kPad)(object, slice);
      object.fragments({compressed(syntax, series.layout(), plane)}, {});
    };
    EXPECT_EQ(import_objects(changed(series, packed_plane)).canonical, plain.canonical);
  }
}

template <class Real>
std::string real_bytes(Real value) {
  std::string bytes(sizeof(value), '\0');
  std::memcpy(bytes.data(), &value, sizeof(value));
  return bytes;
}

// NaN and padding together: neither is in the range or in the suggestion.
TEST(DicomPadding, MayBeReal) {
  const auto change = [](DicomObject& object, std::uint32_t k) {
    std::string samples;
    for (std::uint32_t at = 0; at < 48; ++at) {
      const std::uint32_t i = at % 8;
      const float value = i == 7         ? std::numeric_limits<float>::quiet_NaN()
                          : is_padded(i) ? -1e6F
                                         : static_cast<float>(image_value(i, at / 8, k)) + 0.5F;
      samples += real_bytes(value);
    }
    object.erase(kPixelData)
        .number(kBitsAllocated, 32)
        .erase(kPixelRepresentation)
        .bytes(kFloatPixelPaddingValue, "FL", real_bytes(-1e6F))
        .bytes(kFloatPixelData, "OF", samples);
  };
  const Outcome outcome = imported(import_objects(files_of(padded(kPad), change)));
  EXPECT_EQ(outcome.volume.range[0], kLeast + 0.5);
  EXPECT_THAT(note_detail(outcome, NoteCode::kPadding), HasSubstr("48 of the 192"));
  EXPECT_THAT(note_detail(outcome, NoteCode::kNonFiniteSamples), HasSubstr("24 of the 192"));
  EXPECT_NEAR(outcome.volume.suggested_iso, -475, 3);
}

TEST(DicomPadding, AloneIsNoImage) {
  const auto stored = [](std::uint32_t, std::uint32_t, std::uint32_t) { return kPad; };
  const NamedFiles files = files_of(stored, with_padding(kPad));
  const Outcome outcome = import_objects(files);
  EXPECT_THAT(outcome.error, HasSubstr("All samples have the padding value"));
  EXPECT_THAT(outcome.error, HasSubstr("accept=padding"));
  EXPECT_EQ(imported(import_objects(files, {.accept = {"padding"}})).volume.range[0], kPad);
}

// Masks and label maps that were made from an image keep its header. Their background would become
// the first label.
TEST(DicomPadding, OfZeroAroundLabelsStays) {
  const auto mask = [](std::uint32_t i, std::uint32_t, std::uint32_t) { return i > 3 ? 1 : 0; };
  const Outcome masked = imported(import_objects(files_of(mask, with_padding(0))));
  EXPECT_EQ(masked.volume.range, (std::array<double, 2>{0, 1}));
  EXPECT_EQ(note_detail(masked, NoteCode::kPadding), "");
  const auto labels = [](std::uint32_t i, std::uint32_t j, std::uint32_t) {
    return i < 2 ? 0 : j < 3 ? 1 : 2;
  };
  const Outcome labelled = imported(import_objects(files_of(labels, with_padding(0))));
  EXPECT_EQ(labelled.volume.range, (std::array<double, 2>{0, 2}));
  // Another padding of labels becomes background.
  const auto ignored = [](std::uint32_t i, std::uint32_t j, std::uint32_t) {
    return i < 2 ? 255 : j < 3 ? 0 : j < 4 ? 1 : 2;
  };
  const Outcome cut = imported(import_objects(files_of(ignored, with_padding(255))));
  EXPECT_EQ(cut.volume.range, (std::array<double, 2>{0, 2}));
}

// Flat regions of fractions, as in a PET: no labels, so padding of zero is noted.
TEST(DicomPadding, OfZeroAroundFractionsIsNoted) {
  const auto stored = [](std::uint32_t i, std::uint32_t j, std::uint32_t) {
    return i < 2 ? 0 : j < 3 ? 1 : 2;
  };
  const Outcome outcome =
      imported(import_objects(files_of(stored, [](DicomObject& object, std::uint32_t k) {
        with_padding(0)(object, k);
        object.text(kRescaleSlope, "DS", "0.3").text(kRescaleIntercept, "DS", "0");
      })));
  EXPECT_FLOAT_EQ(static_cast<float>(outcome.volume.range[0]), 0.3F);
  EXPECT_THAT(note_detail(outcome, NoteCode::kPadding), HasSubstr("48 of the 192 samples"));
}

TEST(DicomPadding, WithoutNumbersIsNoImage) {
  const auto change = [](DicomObject& object, std::uint32_t) {
    std::string samples;
    for (std::uint32_t at = 0; at < 48; ++at) {
      samples += real_bytes(is_padded(at % 8) ? -1e6F : std::numeric_limits<float>::quiet_NaN());
    }
    object.erase(kPixelData)
        .number(kBitsAllocated, 32)
        .erase(kPixelRepresentation)
        .bytes(kFloatPixelPaddingValue, "FL", real_bytes(-1e6F))
        .bytes(kFloatPixelData, "OF", samples);
  };
  EXPECT_THAT(import_objects(files_of(padded(kPad), change)).error,
              HasSubstr("48 of the 192 samples have the padding value of the file, and the others "
                        "are not finite numbers, so it holds no image"));
}

}  // namespace
}  // namespace isomesh::import::test
