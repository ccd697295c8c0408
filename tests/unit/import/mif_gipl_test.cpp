// MRtrix' images and GIPL.
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/import/archives.h"
#include "tests/unit/import/files.h"
#include "tests/unit/import/other_writers.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using Vector = std::array<double, 3>;
using Matrix = std::array<double, 9>;

const std::string kSamples(kSmallSamples);

TEST(Mif, ReversedAxesBeginAtTheirOtherEnd) {
  const Outcome outcome = imported(import_bytes(mif({}, kSamples)));
  EXPECT_EQ(outcome.volume.format, "mif");
  EXPECT_EQ(outcome.sample_bytes(), kSamples);
  EXPECT_EQ(outcome.volume.geometry.spacing, (Vector{2, 3, 4}));
  // The transform is RAS, with the voxel (0,0,0) at (10,20,30); x and y are stored backwards.
  EXPECT_EQ(outcome.volume.geometry.origin, (Vector{-(10. + 3 * 2), -(20. + 2 * 3), 30}));
  EXPECT_EQ(outcome.volume.geometry.direction, (Matrix{1, 0, 0, 0, 1, 0, 0, 0, 1}));
  EXPECT_TRUE(outcome.volume.notes.empty());
  const Outcome forward = imported(import_bytes(mif({.layout = "+0,+1,+2"}, kSamples)));
  EXPECT_EQ(forward.volume.geometry.origin, (Vector{-10, -20, 30}));
  EXPECT_EQ(forward.volume.geometry.direction, (Matrix{-1, 0, 0, 0, -1, 0, 0, 0, 1}));
}

TEST(Mif, AxesMayBeStoredInAnyOrder) {
  const Outcome outcome = imported(import_bytes(mif({.layout = "+2,+1,+0"}, kSamples)));
  // z varies fastest, then y.
  std::string right;
  for (std::size_t z = 0; z < 2; ++z) {
    for (std::size_t y = 0; y < 3; ++y) {
      for (std::size_t x = 0; x < 4; ++x) right += kSamples[(x * 3 + y) * 2 + z];
    }
  }
  EXPECT_EQ(outcome.sample_bytes(), right);
}

// A layout that is not its own inverse: y varies fastest, then z.
TEST(Mif, ALayoutGivesEachAxisItsRank) {
  std::string right;
  for (std::size_t z = 0; z < 2; ++z) {
    for (std::size_t y = 0; y < 3; ++y) {
      for (std::size_t x = 0; x < 4; ++x) right += kSamples[(x * 2 + z) * 3 + y];
    }
  }
  EXPECT_EQ(imported(import_bytes(mif({.layout = "+2,+0,+1"}, kSamples))).sample_bytes(), right);
}

// As MRtrix places them, also with an odd number of reversed axes.
TEST(Mif, AxesWithoutATransformAreThoseOfRas) {
  const MifFields fields = {.layout = "-0,+1,+2", .transform = ""};
  const Outcome outcome = imported(import_bytes(mif(fields, kSamples)));
  EXPECT_EQ(outcome.sample_bytes(), kSamples);
  EXPECT_EQ(outcome.volume.geometry.spacing, (Vector{2, 3, 4}));
  // The image is centred: without the reversal its first voxel would be at (-3,-3,-2) in RAS.
  EXPECT_EQ(outcome.volume.geometry.origin, (Vector{-(-3. + 3 * 2), 3, -2}));
  EXPECT_EQ(outcome.volume.geometry.direction, (Matrix{1, 0, 0, 0, -1, 0, 0, 0, 1}));
  EXPECT_THAT(codes_of(outcome), ElementsAre("space-assumed"));
  EXPECT_THAT(outcome.volume.notes[0].detail, HasSubstr("RAS"));
  EXPECT_THAT(import_bytes(mif({.transform = "transform: 1,0,0,0\n"}, kSamples)).error,
              HasSubstr("1 line of three"));
}

TEST(Mif, VolumesMayTakeTurns) {
  const auto second = [](const std::string& layout) {
    const MifFields fields = {.dim = "2,3,2,2", .layout = layout};
    EXPECT_EQ(import_bytes(mif(fields, kSamples)).remedy.choices.size(), 2);
    return std::string(
        imported(import_bytes(mif(fields, kSamples), {}, {.volume = 1})).sample_bytes());
  };
  EXPECT_EQ(second("+0,+1,+2,+3"), "mnopqrstuvwx");
  EXPECT_EQ(second("+1,+2,+3,+0"), "bdfhjlnprtvx");
  EXPECT_EQ(second("+0,+1,+2,-3"), "abcdefghijkl");
}

TEST(Mif, SeveralAxesBeyondSpaceAreRefusedAtOnce) {
  const MifFields fields = {.dim = "1,3,2,2,2", .layout = "+0,+1,+2,+3,+4"};
  const Outcome refused = import_bytes(mif(fields, kSamples));
  EXPECT_TRUE(refused.remedy.choices.empty());
  EXPECT_THAT(refused.error, HasSubstr("mrconvert IN -coord 4 0 OUT"));
}

TEST(Mif, ScalingByteOrderAndDataFilesAreRead) {
  MifFields fields = {.dim = "2,3,2", .datatype = "Int16BE", .more = "scaling: 10,2\n"};
  const std::vector<std::int16_t> stored = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, -1};
  const std::string bytes = bytes_of(stored, true);
  const std::vector<float> right = {10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30, 8};
  EXPECT_EQ(samples_of<float>(imported(import_bytes(mif(fields, bytes)))), right);
  EXPECT_EQ(samples_of<float>(imported(import_bytes(gzip(mif(fields, bytes))))), right);
  fields.file = "a b.dat 5";
  EXPECT_EQ(samples_of<float>(imported(
                import_bytes(zip({{"a.mih", mif(fields, "")}, {"a b.dat", "12345" + bytes}})))),
            right);
  EXPECT_THAT(import_bytes(mif(fields, "")).error, HasSubstr("a b.dat"));
}

// As mrthreshold writes masks: the last byte is not full.
TEST(Mif, BitsAndHalfFloatsAreRead) {
  const MifFields bits = {.dim = "3,2,2", .datatype = "Bit"};
  EXPECT_EQ(samples_of<std::uint8_t>(imported(import_bytes(mif(bits, "\x4b\x90")))),
            (std::vector<std::uint8_t>{0, 1, 0, 0, 1, 0, 1, 1, 1, 0, 0, 1}));
  EXPECT_THAT(import_bytes(mif(bits, "\x4b")).error, HasSubstr("2 bytes of samples"));
  const std::vector<std::uint16_t> halves = {0x3c00, 0xc100, 0, 0, 0, 0, 0, 0};
  EXPECT_EQ(samples_of<float>(imported(
                import_bytes(mif({.dim = "2,2,2", .datatype = "Float16LE"}, bytes_of(halves))))),
            (std::vector<float>{1, -2.5F, 0, 0, 0, 0, 0, 0}));
}

TEST(Mif, BytesBehindPackedSamplesAreToldOrRefused) {
  const MifFields bits = {.dim = "3,2,2", .datatype = "Bit"};
  const MifFields halves = {.dim = "2,3,2", .datatype = "Float16LE"};
  const auto expect_told = [](const MifFields& fields, const std::string& samples) {
    const std::string file = mif(fields, samples + "more");
    MifFields apart = fields;
    apart.file = "a.dat";
    for (const std::string& bytes :
         {file, zip({{"a.mih", mif(apart, "")}, {"a.dat", samples + "more"}})}) {
      const Outcome outcome = imported(import_bytes(bytes));
      EXPECT_THAT(codes_of(outcome), Contains("trailing-bytes"));
      EXPECT_THAT(outcome.volume.notes.at(0).detail, HasSubstr("4 bytes longer"));
    }
    EXPECT_THAT(import_bytes(mif(fields, samples + std::string(5000, 'm'))).error,
                HasSubstr("more than the " + std::to_string(samples.size()) + " bytes"));
    EXPECT_THAT(codes_of(imported(import_bytes(mif(fields, samples)))),
                Not(Contains("trailing-bytes")));
  };
  expect_told(bits, "\x4b\x90");
  expect_told(halves, std::string(24, '\0'));
}

TEST(Mif, DamagedAndUnsupportedOnesAreNamed) {
  EXPECT_THAT(import_bytes(mif({.datatype = "CFloat32LE"}, kSamples)).error,
              HasSubstr("mrconvert"));
  EXPECT_THAT(import_bytes(mif({.layout = "+0,+0,+2"}, kSamples)).error, HasSubstr("layout"));
  EXPECT_THAT(import_bytes(mif({.layout = "+0,+1"}, kSamples)).error, HasSubstr("layout"));
  EXPECT_THAT(import_bytes(mif({.dim = "2,3"}, kSamples)).error, HasSubstr("axes"));
  EXPECT_EQ(import_bytes(mif({.dim = "100000,100000,100000"}, kSamples)).imported(), false);
  const std::string file = mif({}, kSamples);
  for (std::size_t size = 0; size < file.size(); ++size) {
    const Outcome outcome = import_bytes(file.substr(0, size));
    EXPECT_FALSE(outcome.imported()) << size;
    EXPECT_NE(outcome.code, ErrorCode::kInternal) << outcome.error;
  }
}

TEST(Gipl, SamplesSpacingAndOriginAreRead) {
  const std::vector<std::int16_t> stored = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, -1};
  const GiplFields fields = {
      .sizes = {2, 3, 2, 1}, .type = 15, .spacing = {0.5, 1, 2}, .origin = {-12.5, 33.25, 7}};
  const Outcome outcome = imported(import_bytes(gipl(fields, bytes_of(stored, true))));
  EXPECT_EQ(outcome.volume.format, "gipl");
  EXPECT_EQ(samples_of<std::int16_t>(outcome), stored);
  EXPECT_EQ(outcome.volume.geometry.spacing, (Vector{0.5, 1, 2}));
  EXPECT_EQ(outcome.volume.geometry.origin, (Vector{-12.5, 33.25, 7}));
  EXPECT_THAT(codes_of(outcome), ElementsAre("space-assumed"));
}

TEST(Gipl, FramesAreChosenAndFaultsNamed) {
  EXPECT_EQ(imported(import_bytes(gipl({.sizes = {2, 3, 2, 2}}, kSamples), {}, {.volume = 1}))
                .sample_bytes(),
            "mnopqrstuvwx");
  EXPECT_EQ(imported(import_bytes(gipl({.sizes = {4, 3, 2, 0}}, kSamples))).sample_bytes(),
            kSamples);
  EXPECT_THAT(import_bytes(gipl({.type = 1}, kSamples)).error, HasSubstr("type 1"));
  const std::string file = gipl({}, kSamples);
  for (std::size_t size = 0; size < file.size(); ++size) {
    EXPECT_FALSE(import_bytes(file.substr(0, size)).imported()) << size;
  }
}

TEST(OtherFormats, AreNamed) {
  std::string pic(128, '\0');
  pic[0] = pic[2] = pic[4] = pic[14] = 1;
  pic.replace(54, 2, "\x39\x30");
  const std::vector<std::pair<std::string, const char*>> files = {
      {pic, "Bio-Rad"},
      {"!INTERFILE :=\n!imaging modality := nucmed\n", "Interfile"},
      {"MATRIX72v" + std::string(100, '\0'), "ECAT"},
      {bytes_of(std::vector<std::uint16_t>{8, 16, 12, 0}) + "ACR-NEMA 2.0", "ACR-NEMA"},
      {"<nifti_image\n  nifti_type = 'NIFTI-1A'\n", "NIfTI file in ASCII"},
      {R"({"imageType": {"dimension": 3, "componentType": "int16"}})", "itk-wasm"}};
  for (const auto& [file, name] : files) {
    const Outcome outcome = import_bytes(file);
    EXPECT_EQ(outcome.code, ErrorCode::kUnsupportedMedia);
    EXPECT_THAT(outcome.error, HasSubstr(name));
    EXPECT_THAT(import_bytes(zip({{"a", "text"}, {"b.x", file}})).error,
                AllOf(HasSubstr(name), HasSubstr("\"b.x\"")));
  }
}

}  // namespace
}  // namespace isomesh::import::test
