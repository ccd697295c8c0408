#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/volume/geometry.h"
#include "tests/unit/import/files.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using testing::HasSubstr;

Outcome import_metaimage(const Lines& lines, std::string_view payload = kSmallSamples) {
  return import_bytes(metaimage(lines, payload));
}

Outcome import_with(const std::string& name, const std::string& value) {
  return import_metaimage(with(small_metaimage(), name, value));
}

template <class Sample>
void expect_all_encodings(const std::string& type) {
  const auto samples = some_samples<Sample>(24);
  Lines lines = with(small_metaimage(), "ElementType", type);
  for (const bool big_endian : {false, true}) {
    lines = with(lines, "BinaryDataByteOrderMSB", big_endian ? "True" : "False");
    const std::string raw = bytes_of(samples, big_endian);
    const auto imported = [&](const Lines& header, const std::string& payload) {
      const Outcome outcome = import_metaimage(header, payload);
      EXPECT_EQ(outcome.error, "") << type;
      EXPECT_EQ(samples_of<Sample>(outcome), samples) << type;
      EXPECT_EQ(outcome.volume.format, "metaimage");
    };
    imported(lines, raw);
    const Lines compressed = with(lines, "CompressedData", "True");
    imported(compressed, zlib(raw));
    imported(compressed, gzip(raw));
    imported(with(compressed, "CompressedDataSize", std::to_string(zlib(raw).size())),
             zlib(raw) + "behind");
  }
}

TEST(MetaImage, IsReadInEveryTypeAndByteOrder) {
  expect_all_encodings<std::uint8_t>("MET_UCHAR");
  expect_all_encodings<std::int8_t>("MET_CHAR");
  expect_all_encodings<std::uint16_t>("MET_USHORT");
  expect_all_encodings<std::int16_t>("MET_SHORT");
  expect_all_encodings<std::uint32_t>("MET_UINT");
  expect_all_encodings<std::int32_t>("MET_INT");
  expect_all_encodings<std::uint32_t>("MET_ULONG");
  expect_all_encodings<std::int32_t>("MET_LONG");
  expect_all_encodings<float>("MET_FLOAT");
  expect_all_encodings<double>("MET_DOUBLE");
}

TEST(MetaImage, ReadsText) {
  Lines lines = with(with(small_metaimage(), "BinaryData", "False"), "DimSize", "2 2 2");
  lines = with(lines, "ElementType", "MET_SHORT");
  EXPECT_EQ(samples_of<std::int16_t>(import_metaimage(lines, "1 2 3 4 5 6\n-300 7\n")),
            (std::vector<std::int16_t>{1, 2, 3, 4, 5, 6, -300, 7}));
  EXPECT_FALSE(import_metaimage(lines, "1 2 3 4 5 6 -300").imported());
  EXPECT_FALSE(import_metaimage(lines, "1 2 3 4 5 6 -300 7 8").imported());
  EXPECT_FALSE(import_metaimage(lines, "1 2 3 4 5 6 -300 70000").imported());
}

TEST(MetaImage, LiesInLps) {
  Lines lines = with(small_metaimage(), "TransformMatrix", "0 1 0 0 0 1 1 0 0");
  lines = with(with(lines, "Offset", "10 20 30"), "ElementSpacing", "2 3 4");
  const Geometry geometry = import_metaimage(lines).volume.geometry;
  EXPECT_EQ(geometry.origin, (Vector3{10, 20, 30}));
  // The file's rows are the directions of the axes, which are columns here.
  EXPECT_EQ(step_of(geometry, 0), (Vector3{0, 2, 0}));
  EXPECT_EQ(step_of(geometry, 1), (Vector3{0, 0, 3}));
  EXPECT_EQ(step_of(geometry, 2), (Vector3{4, 0, 0}));
}

TEST(MetaImage, KnowsTheOtherNamesOfItsFields) {
  Lines lines = with(small_metaimage(), "Offset", "");
  EXPECT_EQ(import_metaimage(with(lines, "Position", "1 2 3")).volume.geometry.origin,
            (Vector3{1, 2, 3}));
  EXPECT_EQ(import_metaimage(with(lines, "Origin", "1 2 3")).volume.geometry.origin,
            (Vector3{1, 2, 3}));
  EXPECT_THAT(import_with("Position", "1 2 3").error, HasSubstr("contradicts"));
  EXPECT_TRUE(import_with("Position", "0  0 0").imported());
  lines = with(with(small_metaimage(), "ElementSpacing", ""), "ElementSize", "2 3 4");
  EXPECT_EQ(import_metaimage(lines).volume.geometry.spacing, (Vector3{2, 3, 4}));
  EXPECT_EQ(import_with("ElementSize", "2 3 4").volume.geometry.spacing, (Vector3{1, 1, 1}));
}

TEST(MetaImage, HasOneByteOrder) {
  const Lines lines =
      with(with(small_metaimage(), "ElementType", "MET_SHORT"), "BinaryDataByteOrderMSB", "True");
  const std::vector<std::int16_t> samples = some_samples<std::int16_t>(24);
  const auto of = [&](const Lines& header) {
    return import_bytes(metaimage(header, bytes_of(samples, true)));
  };
  EXPECT_EQ(samples_of<std::int16_t>(of(with(lines, "ElementByteOrderMSB", "1"))), samples);
  EXPECT_EQ(samples_of<std::int16_t>(
                of(with(with(lines, "BinaryDataByteOrderMSB", ""), "ElementByteOrderMSB", "True"))),
            samples);
  EXPECT_THAT(of(with(lines, "ElementByteOrderMSB", "False")).error, HasSubstr("contradicts"));
  EXPECT_TRUE(import_with("ElementByteOrderMSB", "True").imported());  // samples of one byte
}

TEST(MetaImage, HonoursItsUnit) {
  EXPECT_EQ(import_with("DistanceUnits", "um").volume.geometry.spacing,
            (Vector3{0.001, 0.001, 0.001}));
  EXPECT_TRUE(import_with("DistanceUnits", "mm").imported());
  EXPECT_FALSE(import_with("DistanceUnits", "ell").imported());
}

TEST(MetaImage, GivesLengthsOfDirectionsToTheSpacing) {
  const Geometry geometry = import_with("TransformMatrix", "2 0 0 0 1 0 0 0 1").volume.geometry;
  EXPECT_EQ(geometry.spacing, (Vector3{2, 1, 1}));
}

TEST(MetaImage, NeverReadsAnotherFile) {
  for (const char* name : {"/etc/passwd", "volume.raw", "LIST", "slice%03d.raw 1 2 1", "Local2"}) {
    EXPECT_THAT(import_with("ElementDataFile", name).error, HasSubstr("names the data file"))
        << name;
  }
  EXPECT_TRUE(import_with("ElementDataFile", "Local").imported());
}

TEST(MetaImage, RefusesSpacingsThatCannotBe) {
  for (const char* spacing : {"1 nan 1", "1 0 1", "1 -1 1", "1 inf 1", "1 1", "1 1 x", "1 1 1 1"}) {
    EXPECT_EQ(import_with("ElementSpacing", spacing).code, ErrorCode::kUnusableVolume) << spacing;
  }
  for (const char* matrix :
       {"1 0 0 0 1 0 0 0 0", "1 0 0 1 0 0 0 0 1", "1 0 0 0 nan 0 0 0 1", "1 0 0 0 1"}) {
    EXPECT_EQ(import_with("TransformMatrix", matrix).code, ErrorCode::kUnusableVolume) << matrix;
  }
  EXPECT_FALSE(import_with("Offset", "0 nan 0").imported());
}

TEST(MetaImage, RefusesWhatIsNoVolumeOfNumbers) {
  EXPECT_THAT(import_with("ElementNumberOfChannels", "3").error, HasSubstr("channels"));
  EXPECT_TRUE(import_with("ElementNumberOfChannels", "1").imported());
  EXPECT_THAT(import_with("ElementType", "MET_FLOAT_ARRAY").error, HasSubstr("MET_FLOAT_ARRAY"));
  EXPECT_THAT(import_with("ObjectType", "Tube").error, HasSubstr("Tube"));
  EXPECT_THAT(import_with("ElementToIntensityFunctionSlope", "nan").error, HasSubstr("Slope"));
  EXPECT_THAT(import_with("ElementToIntensityFunctionSlope", "0").error, HasSubstr("slope"));
  Lines lines = with(with(small_metaimage(), "NDims", "4"), "DimSize", "4 3 1 2");
  lines = with(with(lines, "TransformMatrix", ""), "Offset", "");
  lines = with(lines, "ElementSpacing", "");
  const std::string two = metaimage(with(lines, "DimSize", "2 3 2 2"), kSmallSamples);
  EXPECT_THAT(import_bytes(two).error, HasSubstr("2 volumes"));
  EXPECT_EQ(import_bytes(two, {}, {.volume = 1}).sample_bytes(), kSmallSamples.substr(12));
  EXPECT_TRUE(import_metaimage(with(lines, "DimSize", "4 3 2 1")).imported());
}

// As the choices call them.
std::vector<std::string> titles_of(const Lines& lines) {
  std::vector<std::string> titles;
  for (const Choice& choice : import_metaimage(lines).remedy.choices)
    titles.push_back(choice.title);
  return titles;
}

// PLUS writes tracked ultrasound so.
TEST(MetaImage, OfFlatImagesInTimeIsNoVolume) {
  const auto with_accepted = [](const Lines& lines) {
    return import_bytes(metaimage(lines, kSmallSamples), {}, {.accept = {"frames-as-slices"}});
  };
  Lines four = with(with(small_metaimage(), "NDims", "4"), "DimSize", "4 3 1 2");
  four = with(with(with(four, "TransformMatrix", ""), "Offset", ""), "ElementSpacing", "1 1 4 2");
  Lines old = small_metaimage();
  old.insert(old.end() - 1, {"Seq_Frame0000_Timestamp", "7.25"});
  for (const Lines& lines : {with(small_metaimage(), "Kinds", "domain domain list"),
                             with(small_metaimage(), "Kinds", "domain domain time"), old, four}) {
    const Outcome refused = import_metaimage(lines);
    EXPECT_THAT(refused.error, HasSubstr("a sequence of 2 flat images of 4 x 3 samples"));
    EXPECT_EQ(refused.remedy.overridable, "frames-as-slices");
    const Outcome accepted = imported(with_accepted(lines));
    EXPECT_EQ(accepted.volume.dims, (std::array<std::uint32_t, 3>{4, 3, 2}));
    EXPECT_EQ(accepted.sample_bytes(), kSmallSamples);
    EXPECT_THAT(codes_of(accepted), testing::ElementsAre("frames-as-slices"));
  }
  EXPECT_EQ(with_accepted(four).volume.geometry.spacing, (Vector3{1, 1, 4}));
  EXPECT_TRUE(import_with("Kinds", "domain domain domain").imported());
}

TEST(MetaImage, ItsVolumesAreToldByWhatTheHeaderSays) {
  Lines lines = with(with(small_metaimage(), "NDims", "4"), "DimSize", "2 3 2 2");
  lines = with(with(lines, "TransformMatrix", ""), "Offset", "");
  const Lines plain = with(lines, "ElementSpacing", "1 1 1 1");
  EXPECT_THAT(titles_of(plain), testing::ElementsAre("volume 0", "volume 1"));
  lines = with(with(lines, "ElementSpacing", "1 1 1 0.5"), "Offset", "0 0 0 2");
  EXPECT_THAT(titles_of(lines), testing::ElementsAre("axis 4 at 2", "axis 4 at 2.5"));
  Lines times = plain;
  times.insert(times.begin(),
               {{"Seq_Frame0000_Timestamp", "7.25"}, {"Seq_Frame0001_Timestamp", "8"}});
  times.insert(times.begin(), {"ObjectSubType", "Sequence"});
  EXPECT_THAT(titles_of(times), testing::ElementsAre("time 7.25 s", "time 8 s"));
  Lines five = with(with(plain, "NDims", "5"), "DimSize", "2 3 2 2 2");
  five = with(five, "ElementSpacing", "1 1 1 1 1");
  EXPECT_THAT(titles_of(five),
              testing::ElementsAre("axis 4 at 0, axis 5 at 0", "axis 4 at 1, axis 5 at 0",
                                   "axis 4 at 0, axis 5 at 1", "axis 4 at 1, axis 5 at 1"));
}

TEST(MetaImage, RefusesHeadersThatContradictThemselves) {
  EXPECT_FALSE(import_with("NDims", "2").imported());
  EXPECT_FALSE(import_with("NDims", "11").imported());
  EXPECT_FALSE(import_with("DimSize", "4 3 0").imported());
  EXPECT_FALSE(import_with("DimSize", "4 3 -2").imported());
  EXPECT_FALSE(import_with("DimSize", "4294967295 4294967295 4294967295").imported());
  EXPECT_FALSE(import_with("DimSize", "").imported());
  EXPECT_FALSE(import_with("ElementType", "").imported());
  EXPECT_FALSE(import_with("BinaryData", "perhaps").imported());
  EXPECT_FALSE(import_with("HeaderSize", "100").imported());
  EXPECT_THAT(import_with("CompressedData", "True").error, HasSubstr("corrupt"));
  EXPECT_THAT(import_bytes("NDims = 3\nNDims = 3\n").error, HasSubstr("twice"));
  EXPECT_THAT(import_bytes("NDims = 3\nDimSize = 1 1 1\n").error, HasSubstr("has no end"));
}

}  // namespace
}  // namespace isomesh::import::test
