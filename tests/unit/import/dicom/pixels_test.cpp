// Compressed samples, and what is wrong with them.
#include <algorithm>
#include <cmath>
#include <functional>
#include <span>
#include <sstream>

#include <gdcmImageReader.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/import/dicom/elements/tags.h"
#include "server/import/dicom/pixels/decode.h"
#include "tests/unit/import/dicom/objects.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using namespace dicom;
using testing::AllOf;
using testing::HasSubstr;

constexpr std::string_view kJpegLossless = "1.2.840.10008.1.2.4.70";
constexpr std::string_view kJpegLs = "1.2.840.10008.1.2.4.80";
constexpr std::string_view kJpeg2000 = "1.2.840.10008.1.2.4.90";

// Programs store bits as images of 0 and 1, or of 0 and 255.
TEST(DicomPixels, OfSingleBitsMayBeCompressedAsImages) {
  const PixelLayout bytes = {64, 48, 8, 8, 7, false};
  for (const char set : {'\1', '\xFF'}) {
    std::string native(64 * 48, '\0');
    for (std::size_t at = 1000; at < 1500; ++at) native[at] = set;
    for (const std::string_view syntax : {kJpeg2000, kJpegLs, kJpegLossless}) {
      const std::string stream = compressed(syntax, bytes, native);
      std::vector<std::byte> decoded(native.size());
      decode_bits(syntax, std::as_bytes(std::span(stream)), {64, 48, 1, 1, 0, false}, decoded);
      EXPECT_EQ(std::ranges::count(decoded, std::byte{1}), 500) << syntax;
      EXPECT_EQ(decoded[1000], std::byte{1});
      EXPECT_EQ(decoded[999], std::byte{0});
    }
  }
}

struct Depth {
  unsigned allocated;
  unsigned stored;
  bool is_signed;
};

DicomSeries compressible(const Depth& depth) {
  return {.columns = 32,
          .rows = 24,
          .slices = 3,
          .bits_allocated = depth.allocated,
          .bits_stored = depth.stored,
          .high_bit = depth.stored - 1,
          .is_signed = depth.is_signed,
          .is_smooth = true};
}

NamedFiles compressed_files(DicomSeries series, std::string_view syntax,
                            const std::function<void(std::string&)>& damage = {}) {
  series.syntax = syntax;
  return changed(series, [&](DicomObject& object, std::uint32_t k) {
    std::string stream = compressed(syntax, series.layout(), series.native_bytes(k));
    if (damage && k == 1) damage(stream);
    object.fragments({stream}, {});
  });
}

class DicomSyntax : public testing::TestWithParam<std::tuple<std::string_view, Depth>> {};

TEST_P(DicomSyntax, GivesTheSamplesBack) {
  const auto& [syntax, depth] = GetParam();
  const DicomSeries series = compressible(depth);
  const Outcome plain = imported(import_objects(series.files()));
  const Outcome outcome = imported(import_objects(compressed_files(series, syntax)));
  EXPECT_EQ(outcome.canonical, plain.canonical);
}

INSTANTIATE_TEST_SUITE_P(All, DicomSyntax,
                         testing::Combine(testing::Values(kRle, kJpegLossless, kJpegLs, kJpeg2000),
                                          testing::Values(Depth{8, 8, false}, Depth{16, 12, false},
                                                          Depth{16, 16, false}, Depth{16, 12, true},
                                                          Depth{16, 16, true})));

// A stream may have fewer bytes to a sample than the header allocates.
TEST(DicomPixels, OfBytesMayBeAllocatedWords) {
  for (const bool is_signed : {false, true}) {
    DicomSeries words = compressible({16, 8, is_signed});
    const std::string expected = import_objects(words.files()).canonical;
    const PixelLayout bytes = {words.columns, words.rows, 8, 8, 7, is_signed};
    for (const std::string_view syntax : {kJpegLossless, kJpegLs, kJpeg2000}) {
      words.syntax = syntax;
      const NamedFiles files = changed(words, [&](DicomObject& object, std::uint32_t k) {
        const std::string native = words.native_bytes(k);
        std::string low;
        for (std::size_t at = 0; at < native.size(); at += 2) low += native[at];
        object.fragments({compressed(syntax, bytes, low)}, {});
      });
      const Outcome outcome = import_objects(files);
      EXPECT_EQ(outcome.error, "") << syntax;
      EXPECT_EQ(outcome.canonical, expected) << syntax;
    }
  }
}

// Negative samples would be large positive ones.
TEST(DicomPixels, OfSignedStreamsNeedASignedHeader) {
  const DicomSeries series = compressible({16, 16, false});
  const auto error_of = [&](std::string_view syntax, char size_and_sign) {
    return import_objects(
               compressed_files(series, syntax,
                                [&](std::string& stream) { stream.at(42) = size_and_sign; }))
        .error;
  };
  EXPECT_THAT(error_of(kJpeg2000, '\x89'), HasSubstr("are signed, with 10 bits"));
  EXPECT_EQ(error_of(kJpeg2000, '\x0F'), "");
}

// GDCM ends the process for them.
TEST(DicomPixels, OfMoreBitsThanJpegHasAreRefused) {
  DicomSeries series = compressible({16, 12, false});
  series.syntax = kJpegLossless;
  const NamedFiles files = changed(series, [&](DicomObject& object, std::uint32_t k) {
    std::string stream = compressed(kJpegLossless, series.layout(), series.native_bytes(k));
    stream.at(stream.find("\xFF\xC3") + 4) = 32;
    object.fragments({stream}, {});
    object.number(kBitsAllocated, 32).number(kBitsStored, 32).number(kHighBit, 31);
  });
  EXPECT_THAT(import_objects(files).error,
              HasSubstr("stream has 32 bits, but it may have at most 16"));
}

class DamagedStream : public testing::TestWithParam<std::string_view> {};

TEST_P(DamagedStream, IsRefusedWhereverItEnds) {
  const DicomSeries series = compressible({16, 12, false});
  const std::string whole = compressed(GetParam(), series.layout(), series.native_bytes(1));
  ASSERT_EQ(import_objects(compressed_files(series, GetParam())).error, "");
  // RLE streams of an odd length are padded.
  for (std::size_t size = 0; size + 2 < whole.size(); size += 1 + whole.size() / 60) {
    const Outcome outcome = import_objects(
        compressed_files(series, GetParam(), [&](std::string& stream) { stream.resize(size); }));
    ASSERT_EQ(outcome.code, ErrorCode::kUnusableVolume) << size;
    ASSERT_THAT(outcome.error, HasSubstr("slice 2 of 3")) << size;
  }
}

TEST_P(DamagedStream, OfAnotherSizeIsRefused) {
  const DicomSeries series = compressible({16, 12, false});
  DicomSeries larger = series;
  larger.rows = 28;
  larger.columns = 36;
  const std::string stream = compressed(GetParam(), larger.layout(), larger.native_bytes(1));
  const Outcome outcome =
      import_objects(compressed_files(series, GetParam(), [&](std::string& own) { own = stream; }));
  if (GetParam() == kRle) {
    // Nothing in an RLE stream tells how large it is.
    EXPECT_EQ(outcome.error, "");
  } else {
    EXPECT_THAT(outcome.error, AllOf(HasSubstr("36 x 28"), HasSubstr("32 x 24")));
  }
}

TEST_P(DamagedStream, OfBytesThatAreSomethingElseIsRefused) {
  const DicomSeries series = compressible({16, 12, false});
  for (const std::string& other : {std::string(300, '\xff'), std::string(300, '\0'),
                                   std::string("\xff\xd8\xff\xd9"), std::string()}) {
    const Outcome outcome = import_objects(
        compressed_files(series, GetParam(), [&](std::string& stream) { stream = other; }));
    EXPECT_EQ(outcome.code, ErrorCode::kUnusableVolume);
    EXPECT_NE(outcome.error, "");
  }
}

INSTANTIATE_TEST_SUITE_P(All, DamagedStream,
                         testing::Values(kRle, kJpegLossless, kJpegLs, kJpeg2000));

TEST(DicomFragments, OfOneFrameAreJoined) {
  DicomSeries series = compressible({16, 12, false});
  const std::string expected = import_objects(series.files()).canonical;
  series.syntax = kJpegLs;
  const NamedFiles files = changed(series, [&](DicomObject& object, std::uint32_t k) {
    const std::string stream = compressed(kJpegLs, series.layout(), series.native_bytes(k));
    object.fragments({stream.substr(0, 40), stream.substr(40)}, {0});
  });
  EXPECT_EQ(import_objects(files).canonical, expected);
}

// All frames in one file, of which each lies in two fragments.
std::string in_halves(const DicomSeries& series,
                      const std::function<void(std::vector<std::uint32_t>&)>& change) {
  std::vector<std::string> fragments;
  std::vector<std::uint32_t> offsets;
  std::uint32_t offset = 0;
  for (const std::uint32_t k : {0U, 1U, 2U}) {
    const std::string stream = compressed(kJpeg2000, series.layout(), series.native_bytes(k));
    offsets.push_back(offset);
    for (const std::string& half : {stream.substr(0, 60), stream.substr(60)}) {
      fragments.push_back(half);
      offset += static_cast<std::uint32_t>(half.size()) + 8;
    }
  }
  change(offsets);
  return series.enhanced({0, 1, 2}).fragments(fragments, offsets).file(kJpeg2000);
}

TEST(DicomFragments, OfSeveralFramesAreToldApart) {
  const DicomSeries series = compressible({16, 12, false});
  const Outcome plain = import_objects(series.files());
  using Table = std::vector<std::uint32_t>;
  const std::function<void(Table&)> changes[] = {
      [](Table&) {}, [](Table& table) { table.clear(); },
      [](Table& table) { table.assign(3, 0); },  // wrong ones are of no use
      [](Table& table) {
        for (std::uint32_t& offset : table) offset += 8;
      }};
  for (const auto& change : changes) {
    const Outcome outcome = imported(import_objects({{"one", in_halves(series, change)}}));
    EXPECT_EQ(outcome.canonical, plain.canonical);
  }
}

// Some writers leave out what tells the end.
TEST(DicomFragments, MayEndWithTheFile) {
  const DicomSeries series = compressible({16, 12, false});
  constexpr std::size_t kEndBytes = 8;
  NamedFiles files = compressed_files(series, kJpegLs);
  for (auto& [name, file] : files) file.resize(file.size() - kEndBytes);
  EXPECT_EQ(import_objects(files).canonical, import_objects(series.files()).canonical);
  files[1].second.pop_back();
  EXPECT_EQ(import_objects(files).code, ErrorCode::kUnusableVolume);
}

TEST(DicomFragments, ThatAreMissingAreNoticed) {
  const DicomSeries series = compressible({16, 12, false});
  const std::string stream = compressed(kJpeg2000, series.layout(), series.native_bytes(0));
  const auto error_of = [&](std::vector<std::string> fragments) {
    return import_objects(
               {{"one",
                 series.enhanced({0, 1, 2}).fragments(std::move(fragments), {}).file(kJpeg2000)}})
        .error;
  };
  EXPECT_THAT(error_of({stream, stream}),
              AllOf(HasSubstr("3 frames"), HasSubstr("2 compressed fragments")));
  EXPECT_THAT(error_of({stream, stream, stream, stream}), HasSubstr("cannot be separated"));
}

TEST(DicomFragments, OfAnIconAreNoPixels) {
  const DicomSeries series = compressible({16, 12, false});
  const Outcome outcome = imported(import_objects(changed(series, [](DicomObject& object) {
    object.items(0x00880200,
                 {DicomObject().fragments({std::string("\xff\xd8\xff\xe0 icon", 10)}, {0})});
  })));
  EXPECT_EQ(outcome.canonical, import_objects(series.files()).canonical);
}

TEST(DicomSyntaxes, ThatAreNotReadAreNamed) {
  const DicomSeries series;
  EXPECT_THAT(import_objects(
                  {{"one", series.slice(0).fragments({"xx"}, {}).file("1.2.840.10008.1.2.4.102")}})
                  .error,
              HasSubstr("\"1.2.840.10008.1.2.4.102\""));
  EXPECT_THAT(import_objects({{"one", series.slice(0).file("1.2.840.113619.5.2")}}).error,
              HasSubstr("\"1.2.840.113619.5.2\""));
}

// GDCM independently reads the DICOM files that these tests write.
TEST(DicomObjects, AreReadByGdcm) {
  const DicomSeries series;
  for (const std::string_view syntax : {kImplicit, kExplicit, kBigEndian}) {
    std::istringstream stream(series.slice(2).file(syntax));
    gdcm::ImageReader reader;
    reader.SetStream(stream);
    ASSERT_TRUE(reader.Read()) << syntax;
    const gdcm::Image& image = reader.GetImage();
    std::string bytes(image.GetBufferLength(), '\0');
    ASSERT_TRUE(image.GetBuffer(bytes.data()));
    EXPECT_EQ(bytes, series.native_bytes(2)) << syntax;
    EXPECT_EQ(image.GetSpacing(0), 0.75);
    EXPECT_EQ(image.GetSpacing(1), 0.5);
    EXPECT_EQ(image.GetOrigin(2), 35);
  }
}

// --- Floating-point numbers ----------------------------------------------------------------------

// Frames of which the samples are `at`, `at` + 0.25, ...
template <class Real>
DicomObject real_object(Tag tag, const char* vr) {
  const DicomSeries series;
  std::vector<Real> values;
  for (std::size_t at = 0; at < 3 * series.layout().samples(); ++at) {
    values.push_back(static_cast<Real>(at) * static_cast<Real>(0.25) - 3);
  }
  return series.enhanced({0, 1, 2})
      .erase(kPixelData)
      .erase(kBitsStored)
      .erase(kHighBit)
      .erase(kPixelRepresentation)
      .number(kBitsAllocated, sizeof(Real) * 8)
      .bytes(tag, vr, bytes_of(values));
}

template <class Real>
void expect_reals(const DicomObject& object, SampleType type) {
  const Outcome outcome = imported(import_objects({{"map", object.file()}}));
  EXPECT_EQ(outcome.volume.type, type);
  const auto samples = samples_of<Real>(outcome);
  for (std::size_t at = 0; at < samples.size(); ++at) {
    ASSERT_EQ(samples[at], static_cast<Real>(at) * static_cast<Real>(0.25) - 3);
  }
}

TEST(DicomReals, AreReadAsTheyAre) {
  expect_reals<float>(real_object<float>(kFloatPixelData, "OF"), SampleType::kFloat32);
  expect_reals<double>(real_object<double>(kDoubleFloatPixelData, "OD"), SampleType::kFloat64);
}

TEST(DicomReals, AreScaled) {
  DicomObject object = real_object<float>(kFloatPixelData, "OF");
  object.text(kRescaleSlope, "DS", "2").text(kRescaleIntercept, "DS", "1");
  const Outcome outcome = imported(import_objects({{"map", object.file()}}));
  EXPECT_EQ(samples_of<float>(outcome)[4], -3);
}

TEST(DicomReals, AreRefusedWhenSomeAreMissing) {
  DicomObject object = real_object<double>(kDoubleFloatPixelData, "OD");
  object.bytes(kDoubleFloatPixelData, "OD", std::string(400, 'x'));
  EXPECT_THAT(import_objects({{"map", object.file()}}).error,
              HasSubstr("take 480 bytes, but the file has 400"));
}

// --- Parametric maps -----------------------------------------------------------------------------

std::string real_bytes(double value) { return bytes_of(std::vector{value}); }

DicomObject mapping(double slope, double intercept) {
  return DicomObject()
      .bytes(kRealWorldValueSlope, "FD", real_bytes(slope))
      .bytes(kRealWorldValueIntercept, "FD", real_bytes(intercept));
}

DicomObject with_range(DicomObject item, unsigned first, unsigned last) {
  return item.number(kRealWorldValueFirst, first).number(kRealWorldValueLast, last);
}

// A map of 12-bit integers in six frames; each has the mappings that `mappings_of` returns.
DicomObject map_of(const std::function<std::vector<DicomObject>(std::uint32_t)>& mappings_of) {
  const DicomSeries series;
  std::vector<DicomObject> frames;
  for (std::uint32_t k = 0; k < series.slices; ++k) {
    DicomObject frame = frame_at(series.position(k));
    const std::vector<DicomObject> mappings = mappings_of(k);
    if (!mappings.empty()) frame.items(kRealWorldValueMappingSequence, mappings);
    frames.push_back(frame);
  }
  return series.enhanced({0, 1, 2, 3, 4, 5})
      .text(kSopClassUid, "UI", "1.2.840.10008.5.1.4.1.1.30")
      .items(kPerFrameFunctionalGroups, frames);
}

Outcome import_map(const std::vector<DicomObject>& mappings) {
  return import_objects({{"map", map_of([&](std::uint32_t) { return mappings; }).file()}});
}

TEST(DicomMaps, HaveRealWorldValues) {
  const DicomSeries series;
  for (const std::string_view syntax : {kImplicit, kExplicit}) {
    const Outcome outcome =
        imported(import_objects({{"map", map_of([](std::uint32_t k) {
                                           return std::vector<DicomObject>{mapping(k + 0.5, -10)};
                                         }).file(syntax)}}));
    const auto samples = samples_of<float>(outcome);
    for (std::uint32_t k = 0; k < series.slices; ++k) {
      EXPECT_EQ(samples[k * 20 + 7], static_cast<double>(series.stored(2, 1, k)) * (k + 0.5) - 10);
    }
    EXPECT_THAT(note_detail(outcome, NoteCode::kValuesRescaled), HasSubstr("slope and intercept"));
  }
  const Outcome plain = import_map({mapping(1, 0)});
  EXPECT_EQ(samples_of<std::uint16_t>(plain)[7], series.stored(2, 1, 0));
  EXPECT_EQ(note_detail(plain, NoteCode::kValuesRescaled), "");
}

TEST(DicomMaps, OfRealsMayShareAMapping) {
  DicomObject object = real_object<float>(kFloatPixelData, "OF");
  object.text(kSopClassUid, "UI", "1.2.840.10008.5.1.4.1.1.30");
  object.items(kSharedFunctionalGroups,
               {shared_groups().items(kRealWorldValueMappingSequence, {mapping(2, 10)})});
  const Outcome outcome = imported(import_objects({{"map", object.file()}}));
  EXPECT_EQ(outcome.volume.type, SampleType::kFloat32);
  EXPECT_EQ(samples_of<float>(outcome)[5], (5 * 0.25F - 3) * 2 + 10);
  // A CT image's values are those of its rescale.
  object.text(kSopClassUid, "UI", "1.2.840.10008.5.1.4.1.1.2.1");
  EXPECT_EQ(samples_of<float>(import_objects({{"map", object.file()}}))[5], 5 * 0.25F - 3);
}

TEST(DicomMaps, WithSeveralMappingsHaveTheFirstForAllSamples) {
  const DicomSeries series;
  const Outcome same = import_map({mapping(3, 1), mapping(3, 1)});
  EXPECT_EQ(samples_of<std::uint16_t>(same)[7], series.stored(2, 1, 0) * 3 + 1);
  EXPECT_THAT(note_detail(same, NoteCode::kValuesRescaled), Not(HasSubstr("mappings")));
  const Outcome units = import_map({mapping(3, 1), mapping(3000, 1000)});
  EXPECT_EQ(units.canonical, same.canonical);
  EXPECT_THAT(note_detail(units, NoteCode::kValuesRescaled), HasSubstr("2 mappings"));
  const Outcome wide =
      import_map({with_range(mapping(2, 1), 0, 99), with_range(mapping(3, 1), 0, 4095)});
  EXPECT_EQ(wide.canonical, same.canonical);
  EXPECT_THAT(
      import_map({with_range(mapping(2, 1), 0, 99), with_range(mapping(3, 1), 100, 4095)}).error,
      HasSubstr("2 mappings apply to different stored values"));
}

TEST(DicomMaps, WithoutAUsableMappingAreRefused) {
  DicomObject table;
  table.bytes(kRealWorldValueLutData, "FD", real_bytes(1) + real_bytes(2));
  EXPECT_THAT(import_map({table}).error, HasSubstr("only lookup tables (0040,9212)"));
  EXPECT_EQ(import_map({table, mapping(3, 1)}).error, "");
  EXPECT_THAT(import_map({mapping(0, 1)}).error, HasSubstr("slope (0040,9225) is 0"));
  EXPECT_THAT(import_map({mapping(1, NAN)}).error, HasSubstr("intercept (0040,9224)"));
  EXPECT_THAT(import_map({DicomObject()}).error, HasSubstr("slope (0040,9225)"));
  EXPECT_THAT(import_objects({{"map", map_of([](std::uint32_t k) {
                                        return k == 3 ? std::vector<DicomObject>{}
                                                      : std::vector<DicomObject>{mapping(2, 0)};
                                      }).file()}})
                  .error,
              HasSubstr("frame 4 differs from"));
}

}  // namespace
}  // namespace isomesh::import::test
