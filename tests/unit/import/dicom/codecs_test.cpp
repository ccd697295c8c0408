// Frames that other encoders than GDCM make: HTJ2K, JPEG XL, and encapsulated ones without
// compression.
#include <algorithm>
#include <cstdlib>
#include <functional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <jxl/encode.h>
#include <jxl/encode_cxx.h>

#include "base/hex.h"
#include "server/import/dicom/elements/tags.h"
#include "server/import/dicom/pixels/decode.h"
#include "tests/unit/import/dicom/htj2k_streams.h"
#include "tests/unit/import/dicom/objects.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using namespace dicom;
using testing::AllOf;
using testing::HasSubstr;

constexpr std::string_view kHtj2k = "1.2.840.10008.1.2.4.201";
constexpr std::string_view kHtj2kRpcl = "1.2.840.10008.1.2.4.202";
constexpr std::string_view kHtj2kLossy = "1.2.840.10008.1.2.4.203";
constexpr std::string_view kJpegXlLossless = "1.2.840.10008.1.2.4.110";
constexpr std::string_view kJpegXlOfJpeg = "1.2.840.10008.1.2.4.111";
constexpr std::string_view kJpegXl = "1.2.840.10008.1.2.4.112";

std::vector<std::byte> decoded(std::string_view syntax, const std::string& stream,
                               const PixelLayout& layout) {
  std::vector<std::byte> samples(layout.frame_bytes());
  decode_frame(syntax, std::as_bytes(std::span(stream)), layout, samples);
  return samples;
}

std::int64_t sample_at(std::span<const std::byte> samples, std::size_t at,
                       const PixelLayout& layout) {
  auto word = std::to_integer<std::int64_t>(samples[at * (layout.bits_allocated / 8)]);
  if (layout.bits_allocated == 16) {
    word |= std::to_integer<std::int64_t>(samples[at * 2 + 1]) << 8;
  }
  const std::int64_t count = std::int64_t{1} << layout.bits_stored;
  word &= count - 1;
  return layout.is_signed && word >= count / 2 ? word - count : word;
}

// --- HTJ2K ---------------------------------------------------------------------------------------

PixelLayout htj2k_layout(unsigned bits, bool is_signed) {
  return {htj2k::kColumns, htj2k::kRows, bits > 8 ? 16U : 8U, bits, bits - 1, is_signed};
}

std::int64_t largest_error(std::string_view syntax, std::string_view hex, unsigned bits,
                           bool is_signed) {
  const PixelLayout layout = htj2k_layout(bits, is_signed);
  const auto samples = decoded(syntax, from_hex(hex).value(), layout);
  std::int64_t largest = 0;
  for (std::uint32_t j = 0; j < htj2k::kRows; ++j) {
    for (std::uint32_t i = 0; i < htj2k::kColumns; ++i) {
      const std::int64_t sample = sample_at(samples, j * htj2k::kColumns + i, layout);
      largest = std::max(largest, std::abs(sample - htj2k::sample(i, j, bits, is_signed)));
    }
  }
  return largest;
}

TEST(DicomHtj2k, GivesTheEncodersInput) {
  for (const std::string_view syntax : {kHtj2k, kHtj2kRpcl, kHtj2kLossy}) {
    EXPECT_EQ(largest_error(syntax, htj2k::kBytes, 8, false), 0) << syntax;
    EXPECT_EQ(largest_error(syntax, htj2k::kTwelveBits, 12, false), 0) << syntax;
    EXPECT_EQ(largest_error(syntax, htj2k::kWords, 16, false), 0) << syntax;
    EXPECT_EQ(largest_error(syntax, htj2k::kSignedWords, 16, true), 0) << syntax;
  }
}

TEST(DicomHtj2k, MayBeLossy) {
  const std::int64_t error = largest_error(kHtj2kLossy, htj2k::kLossy, 12, false);
  EXPECT_GT(error, 0);
  EXPECT_LT(error, 16);
}

TEST(DicomHtj2k, IsRefusedWhereverItEnds) {
  const std::string whole = from_hex(htj2k::kTwelveBits).value();
  const PixelLayout layout = htj2k_layout(12, false);
  for (std::size_t size = 0; size < whole.size(); size += 7) {
    EXPECT_THROW(decoded(kHtj2k, whole.substr(0, size), layout), Error) << size;
  }
}

// --- JPEG XL -------------------------------------------------------------------------------------

enum class Loss { kNone, kVisuallyNone };

struct Wrapping {
  bool is_container = false;
  unsigned channels = 1;
};

std::string finished(JxlEncoder* encoder) {
  JxlEncoderCloseInput(encoder);
  std::string bytes(std::size_t{1} << 16, '\0');
  auto* next = reinterpret_cast<std::uint8_t*>(bytes.data());
  std::size_t room = bytes.size();
  if (JxlEncoderProcessOutput(encoder, &next, &room) != JXL_ENC_SUCCESS) {
    throw std::logic_error("libjxl cannot encode");
  }
  bytes.resize(bytes.size() - room);
  if (bytes.size() % 2 != 0) bytes += '\0';
  return bytes;
}

void require(JxlEncoderStatus status) {
  if (status != JXL_ENC_SUCCESS) throw std::logic_error("libjxl refuses");
}

// One frame's stored bits, without their sign, as JPEG XL.
std::string jpeg_xl_of(const PixelLayout& layout, const std::string& native, Loss loss,
                       const Wrapping& wrapping = {}) {
  const auto bytes = std::as_bytes(std::span(native));
  const auto largest = static_cast<float>((1U << layout.bits_stored) - 1);
  std::vector<float> shares;
  PixelLayout bits = layout;
  bits.is_signed = false;
  for (std::size_t at = 0; at < layout.samples(); ++at) {
    shares.insert(shares.end(), wrapping.channels,
                  static_cast<float>(sample_at(bytes, at, bits)) / largest);
  }
  const auto encoder = JxlEncoderMake(nullptr);
  JxlBasicInfo info;
  JxlEncoderInitBasicInfo(&info);
  info.xsize = layout.columns;
  info.ysize = layout.rows;
  info.bits_per_sample = layout.bits_stored;
  info.num_color_channels = wrapping.channels;
  info.uses_original_profile = loss == Loss::kNone ? JXL_TRUE : JXL_FALSE;
  require(JxlEncoderUseContainer(encoder.get(), wrapping.is_container ? JXL_TRUE : JXL_FALSE));
  if (layout.bits_stored > 12) require(JxlEncoderSetCodestreamLevel(encoder.get(), 10));
  require(JxlEncoderSetBasicInfo(encoder.get(), &info));
  JxlColorEncoding colours;
  JxlColorEncodingSetToSRGB(&colours, wrapping.channels == 1 ? JXL_TRUE : JXL_FALSE);
  require(JxlEncoderSetColorEncoding(encoder.get(), &colours));
  JxlEncoderFrameSettings* settings = JxlEncoderFrameSettingsCreate(encoder.get(), nullptr);
  if (loss == Loss::kNone) require(JxlEncoderSetFrameLossless(settings, JXL_TRUE));
  const JxlPixelFormat format = {wrapping.channels, JXL_TYPE_FLOAT, JXL_NATIVE_ENDIAN, 0};
  require(JxlEncoderAddImageFrame(settings, &format, shares.data(), shares.size() * sizeof(float)));
  return finished(encoder.get());
}

struct Depth {
  unsigned allocated;
  unsigned stored;
  bool is_signed;
};

DicomSeries series_of(const Depth& depth, bool is_smooth = false) {
  return {.columns = 32,
          .rows = 24,
          .slices = 3,
          .bits_allocated = depth.allocated,
          .bits_stored = depth.stored,
          .high_bit = depth.stored - 1,
          .is_signed = depth.is_signed,
          .is_smooth = is_smooth};
}

class DicomJpegXl : public testing::TestWithParam<Depth> {};

TEST_P(DicomJpegXl, GivesTheSamplesBack) {
  DicomSeries series = series_of(GetParam());
  const Outcome plain = imported(import_objects(series.files()));
  for (const std::string_view syntax : {kJpegXlLossless, kJpegXl}) {
    for (const bool is_container : {false, true}) {
      series.syntax = syntax;
      const Outcome outcome =
          imported(import_objects(changed(series, [&](DicomObject& object, std::uint32_t k) {
            object.fragments({jpeg_xl_of(series.layout(), series.native_bytes(k), Loss::kNone,
                                         {.is_container = is_container})},
                             {});
          })));
      EXPECT_EQ(outcome.canonical, plain.canonical);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, DicomJpegXl,
                         testing::Values(Depth{8, 8, false}, Depth{8, 8, true}, Depth{16, 8, false},
                                         Depth{16, 12, false}, Depth{16, 12, true},
                                         Depth{16, 16, false}, Depth{16, 16, true}));

TEST(DicomJpegXlStream, MayBeLossy) {
  const DicomSeries series = series_of({16, 12, false}, true);
  const PixelLayout layout = series.layout();
  const auto samples =
      decoded(kJpegXl, jpeg_xl_of(layout, series.native_bytes(1), Loss::kVisuallyNone), layout);
  std::int64_t largest = 0;
  for (std::uint32_t at = 0; at < layout.samples(); ++at) {
    const std::int64_t input = series.stored(at % layout.columns, at / layout.columns, 1);
    largest = std::max(largest, std::abs(sample_at(samples, at, layout) - input));
  }
  EXPECT_GT(largest, 0);
  EXPECT_LT(largest, 41);  // a hundredth of the range
}

// The samples are those that a decoder of JPEG finds, which rounds otherwise.
TEST(DicomJpegXlStream, MayHoldAJpeg) {
  constexpr std::string_view kJpegBaseline = "1.2.840.10008.1.2.4.50";
  const DicomSeries series = series_of({8, 8, false}, true);
  const PixelLayout layout = series.layout();
  const std::string jpeg = compressed(kJpegBaseline, layout, series.native_bytes(1));
  const auto encoder = JxlEncoderMake(nullptr);
  require(JxlEncoderUseContainer(encoder.get(), JXL_TRUE));
  require(JxlEncoderStoreJPEGMetadata(encoder.get(), JXL_TRUE));
  JxlEncoderFrameSettings* settings = JxlEncoderFrameSettingsCreate(encoder.get(), nullptr);
  require(JxlEncoderAddJPEGFrame(settings, reinterpret_cast<const std::uint8_t*>(jpeg.data()),
                                 jpeg.size()));
  const auto samples = decoded(kJpegXlOfJpeg, finished(encoder.get()), layout);
  const auto expected = decoded(kJpegBaseline, jpeg, layout);
  for (std::size_t at = 0; at < samples.size(); ++at) {
    ASSERT_NEAR(std::to_integer<int>(samples[at]), std::to_integer<int>(expected[at]), 1) << at;
  }
}

TEST(DicomJpegXlStream, IsRefusedWhereverItEnds) {
  const DicomSeries series = series_of({16, 12, false});
  const PixelLayout layout = series.layout();
  for (const bool is_container : {false, true}) {
    const std::string whole =
        jpeg_xl_of(layout, series.native_bytes(0), Loss::kNone, {.is_container = is_container});
    EXPECT_NO_THROW(decoded(kJpegXlLossless, whole, layout));
    // The last byte may be padding.
    for (std::size_t size = 0; size + 2 < whole.size(); size += 1 + whole.size() / 60) {
      EXPECT_THROW(decoded(kJpegXlLossless, whole.substr(0, size), layout), Error) << size;
    }
  }
}

std::string error_of(const std::string& stream, const PixelLayout& layout) {
  try {
    decoded(kJpegXlLossless, stream, layout);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(DicomJpegXlStream, OfAnotherSizeIsRefusedBeforeItIsDecoded) {
  const DicomSeries series = series_of({16, 12, false});
  const std::string stream = jpeg_xl_of(series.layout(), series.native_bytes(0), Loss::kNone);
  PixelLayout other = series.layout();
  other.rows = 25;
  EXPECT_THAT(error_of(stream, other), AllOf(HasSubstr("32 x 24"), HasSubstr("32 x 25")));
  other = series.layout();
  other.bits_allocated = 8;
  EXPECT_THAT(error_of(stream, other), HasSubstr("have 12 bits"));
  const std::string colours =
      jpeg_xl_of(series.layout(), series.native_bytes(0), Loss::kNone, {.channels = 3});
  EXPECT_THAT(error_of(colours, series.layout()), HasSubstr("with 3 components"));
  EXPECT_THAT(error_of(std::string(300, '\xFF'), series.layout()),
              HasSubstr("not a JPEG XL lossless stream"));
}

// The beginning of a black image of 9000 x 9000 samples that cjxl 0.7.0 wrote.
TEST(DicomJpegXlStream, ThatNeedsTooMuchMemoryIsRefused) {
  const std::string stream = from_hex("ff0a3c192120282e04080201001c00000000000000000000").value();
  EXPECT_THAT(error_of(stream, {9000, 9000, 8, 8, 7, false}),
              HasSubstr("81000000 samples, more than the 67108864"));
}

// --- Fragments -----------------------------------------------------------------------------------

// All frames in one object, in two fragments each, without a table of their beginnings.
Outcome in_halves(const DicomSeries& series, std::string_view syntax,
                  const std::function<std::string(std::uint32_t)>& stream_of) {
  std::vector<std::string> fragments;
  for (std::uint32_t k = 0; k < series.slices; ++k) {
    const std::string stream = stream_of(k);
    const std::size_t half = stream.size() / 4 * 2;
    fragments.push_back(stream.substr(0, half));
    fragments.push_back(stream.substr(half));
  }
  return import_objects(
      {{"one", series.enhanced({0, 1, 2}).fragments(fragments, {}).file(syntax)}});
}

TEST(DicomCodecs, TellFramesApartThatLieInSeveralFragments) {
  const DicomSeries series = series_of({16, 12, false});
  const std::string expected = imported(import_objects(series.files())).canonical;
  for (const bool is_container : {false, true}) {
    const Outcome outcome = imported(in_halves(series, kJpegXlLossless, [&](std::uint32_t k) {
      return jpeg_xl_of(series.layout(), series.native_bytes(k), Loss::kNone,
                        {.is_container = is_container});
    }));
    EXPECT_EQ(outcome.canonical, expected);
  }
  const DicomSeries small = {.columns = htj2k::kColumns, .rows = htj2k::kRows, .slices = 3};
  const Outcome outcome = imported(in_halves(small, kHtj2kRpcl, [](std::uint32_t) {
    std::string stream = from_hex(htj2k::kTwelveBits).value();
    return stream.size() % 2 == 0 ? stream : stream + '\0';
  }));
  const auto samples = samples_of<std::uint16_t>(outcome);
  EXPECT_EQ(samples[2 * 16 * 12 + 5 * 16 + 3], htj2k::sample(3, 5, 12, false));
}

// --- Encapsulated samples without compression ----------------------------------------------------

TEST(DicomEncapsulated, SamplesNeedNoCompression) {
  for (const Depth& depth : {Depth{8, 8, false}, Depth{16, 12, true}, Depth{32, 20, false}}) {
    DicomSeries series = series_of(depth);
    series.columns = 5;  // rows and columns are odd, so a byte is padded
    series.rows = 3;
    const std::string expected = imported(import_objects(series.files())).canonical;
    series.syntax = kEncapsulatedUncompressed;
    const auto frame_of = [&](std::uint32_t k) {
      std::string bytes = series.native_bytes(k);
      return bytes.size() % 2 == 0 ? bytes : bytes + '\0';
    };
    EXPECT_EQ(import_objects(
                  changed(series, [&](DicomObject& object,
                                      std::uint32_t k) { object.fragments({frame_of(k)}, {0}); }))
                  .canonical,
              expected);
    const DicomObject enhanced =
        series.enhanced({0, 1, 2}).fragments({frame_of(0), frame_of(1), frame_of(2)}, {});
    EXPECT_EQ(import_objects({{"one", enhanced.file(kEncapsulatedUncompressed)}}).canonical,
              expected);
    DicomObject cut = series.enhanced({0, 1, 2});
    cut.fragments({frame_of(0), frame_of(1).substr(0, 8), frame_of(2)}, {});
    EXPECT_THAT(import_objects({{"one", cut.file(kEncapsulatedUncompressed)}}).error,
                HasSubstr("slice 2 of 3: its samples end before its size does"));
  }
}

TEST(DicomEncapsulated, BitsArePackedFrameByFrame) {
  const std::string packed("\x05\x80", 2);
  std::vector<std::byte> bits(15);
  decode_bits(kEncapsulatedUncompressed, std::as_bytes(std::span(packed)), {5, 3, 1, 1, 0, false},
              bits);
  EXPECT_EQ(std::ranges::count(bits, std::byte{1}), 2);
  EXPECT_EQ(bits[0], std::byte{1});
  EXPECT_EQ(bits[2], std::byte{1});
}

}  // namespace
}  // namespace isomesh::import::test
