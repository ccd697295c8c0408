#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/volume/geometry.h"
#include "tests/unit/import/files.h"
#include "tests/unit/import/vti_writer.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using testing::HasSubstr;

constexpr VtiForm kBinaryForms[] = {VtiForm::kBinary, VtiForm::kAppendedRaw,
                                    VtiForm::kAppendedBase64};

template <class Sample>
void expect_all_encodings(const std::string& type) {
  const auto samples = some_samples<Sample>(24);
  for (const VtiForm form : kBinaryForms) {
    for (const int variant : {0, 1, 2, 3, 4, 5, 6, 7}) {
      VtiFields fields{.form = form, .type = type};
      fields.big_endian = (variant & 1) != 0;
      fields.compressed = (variant & 2) != 0;
      fields.wide_header = (variant & 4) != 0;
      const Outcome outcome = import_bytes(vti(fields, bytes_of(samples, fields.big_endian)));
      ASSERT_EQ(outcome.error, "") << type << " " << variant << " " << static_cast<int>(form);
      EXPECT_EQ(samples_of<Sample>(outcome), samples) << type << " " << variant;
      EXPECT_EQ(outcome.volume.format, "vti");
    }
  }
}

TEST(Vti, IsReadInEveryTypeAndEncoding) {
  expect_all_encodings<std::uint8_t>("UInt8");
  expect_all_encodings<std::int8_t>("Int8");
  expect_all_encodings<std::uint16_t>("UInt16");
  expect_all_encodings<std::int16_t>("Int16");
  expect_all_encodings<std::uint32_t>("UInt32");
  expect_all_encodings<std::int32_t>("Int32");
  expect_all_encodings<float>("Float32");
  expect_all_encodings<double>("Float64");
}

TEST(Vti, ReadsText) {
  const VtiFields fields{.form = VtiForm::kAscii, .type = "Int16", .extent = "0 1 0 1 0 1"};
  EXPECT_EQ(samples_of<std::int16_t>(import_bytes(vti(fields, "-300 7\n 8 9 1 2 3 4"))),
            (std::vector<std::int16_t>{-300, 7, 8, 9, 1, 2, 3, 4}));
  EXPECT_FALSE(import_bytes(vti(fields, "-300 7 8 9 1 2 3")).imported());
  EXPECT_FALSE(import_bytes(vti(fields, "-300 7 8 9 1 2 3 4 5")).imported());
  EXPECT_FALSE(import_bytes(vti(fields, "-300 7 8 9 1 2 3 70000")).imported());
  EXPECT_FALSE(import_bytes(vti(fields, "1 2 3 4 5 6 7 <!-- 8 --> 9")).imported());
  EXPECT_FALSE(import_bytes(vti(fields, "1 2 3 4 5 6 7 &#56;")).imported());
}

constexpr std::array kCompressors = {"vtkZLibDataCompressor", "vtkLZ4DataCompressor",
                                     "vtkLZMADataCompressor"};

// Whatever is turned over or left out: no crash, and no other number of samples. LZ4 has no
// checksum, so other samples can come of it.
TEST(Vti, DamagedBlocksAreRefused) {
  for (const char* compressor : {kCompressors[1], kCompressors[2]}) {
    const VtiFields fields{.compressed = true, .block_bytes = 24, .compressor = compressor};
    const std::string file = vti(fields, kSmallSamples);
    const std::size_t begin = file.find("_<&") + 3;
    const std::size_t end = file.find("\n</AppendedData>");
    for (std::size_t cut = begin; cut < end; cut += 3) {
      std::string shorter = file;
      shorter.erase(cut, 1);
      const Outcome outcome = import_bytes(shorter);
      EXPECT_FALSE(outcome.imported() && compressor == kCompressors[2]) << cut;
      if (outcome.imported()) {
        EXPECT_EQ(outcome.sample_bytes().size(), kSmallSamples.size()) << cut;
      }
    }
    for (std::size_t at = begin; at < end; ++at) {
      std::string other = file;
      other[at] = static_cast<char>(other[at] ^ 0x10);
      const Outcome outcome = import_bytes(other);
      if (outcome.imported()) {
        EXPECT_EQ(outcome.sample_bytes().size(), kSmallSamples.size()) << compressor << ' ' << at;
      }
    }
  }
}

TEST(Vti, ReadsOneBlockAndBlocksThatFillTheArray) {
  for (const std::uint64_t block : {1U, 6U, 24U}) {
    for (const VtiForm form : kBinaryForms) {
      for (const char* compressor : kCompressors) {
        const VtiFields fields{
            .form = form, .compressed = true, .block_bytes = block, .compressor = compressor};
        EXPECT_EQ(import_bytes(vti(fields, kSmallSamples)).sample_bytes(), kSmallSamples)
            << compressor << ' ' << block;
      }
    }
  }
}

TEST(Vti, LiesWhereItsFirstSampleDoes) {
  const VtiFields fields{.extent = "2 5 -1 1 10 11",
                         .origin = "100 200 300",
                         .spacing = "1 2 3",
                         .direction = "0 -1 0 1 0 0 0 0 1"};
  const Outcome outcome = imported(import_bytes(vti(fields, kSmallSamples)));
  EXPECT_EQ(outcome.volume.dims, (std::array<std::uint32_t, 3>{4, 3, 2}));
  // 2 steps along y, -1 step of 2 along -x, 10 of 3 along z.
  EXPECT_EQ(outcome.volume.geometry.origin, (Vector3{102, 202, 330}));
  EXPECT_EQ(step_of(outcome.volume.geometry, 0), (Vector3{0, 1, 0}));
  EXPECT_EQ(step_of(outcome.volume.geometry, 1), (Vector3{-2, 0, 0}));
}

TEST(Vti, TakesTheScalarsAmongSeveralArrays) {
  const std::string other =
      "<DataArray Name=\"other\" type=\"UInt8\" format=\"appended\" offset=\"0\"/>\n";
  EXPECT_EQ(import_bytes(vti({.more = other}, kSmallSamples)).sample_bytes(), kSmallSamples);
  EXPECT_THAT(import_bytes(vti({.scalars = "absent"}, kSmallSamples)).error, HasSubstr("absent"));
  const std::string unnamed = vti({.scalars = "", .more = other}, kSmallSamples);
  const Outcome several = import_bytes(unnamed);
  ASSERT_EQ(several.remedy.choices.size(), 2);
  EXPECT_EQ(several.remedy.choices[0].title, "array \"other\"");
  EXPECT_EQ(several.remedy.choices[1].title, "array \"samples\"");
  const Outcome chosen = imported(import_bytes(unnamed, {}, {.volume = 1}));
  EXPECT_EQ(chosen.sample_bytes(), kSmallSamples);
  EXPECT_THAT(codes_of(chosen), testing::ElementsAre("volume-chosen"));
}

TEST(Vti, ArraysThatCannotBeSamplesNeedNoChoice) {
  std::string beside;
  for (const std::string attributes :
       {"Name=\"vtkGhostType\" type=\"UInt8\"", "Name=\"vtkValidPointMask\" type=\"Int8\"",
        "Name=\"velocity\" type=\"Float32\" NumberOfComponents=\"3\""}) {
    beside += "<DataArray " + attributes + " format=\"appended\" offset=\"0\"/>\n";
  }
  const Outcome outcome =
      imported(import_bytes(vti({.scalars = "", .more = beside}, kSmallSamples)));
  EXPECT_EQ(outcome.sample_bytes(), kSmallSamples);
  EXPECT_THAT(
      import_bytes(vti({.components = "3", .scalars = "", .more = beside}, kSmallSamples)).error,
      HasSubstr("no array of single numbers"));
}

TEST(Vti, RefusesWhatIsNoVolumeOfNumbers) {
  const auto error = [](const VtiFields& fields) {
    return import_bytes(vti(fields, kSmallSamples)).error;
  };
  EXPECT_THAT(error({.components = "3"}), HasSubstr("components"));
  EXPECT_THAT(error({.kind = "PolyData"}), HasSubstr("PolyData"));
  EXPECT_THAT(error({.type = "String"}), HasSubstr("String"));
  EXPECT_THAT(error({.compressed = true, .compressor = "vtkOtherDataCompressor"}),
              HasSubstr("vtkOtherDataCompressor"));
  EXPECT_THAT(error({.piece_extent = "0 3 0 2 0 0"}), HasSubstr("whole extent"));
  for (const char* extent : {"", "0 3 0 2", "0 3 0 2 1 0", "0 3 0 2 0 x", "0 9999999999 0 1 0 1",
                             "-2147483647 2147483647 -2147483647 2147483647 0 99"}) {
    EXPECT_NE(error({.extent = extent}), "") << extent;
  }
  for (const char* spacing : {"0 1 1", "-1 1 1", "nan 1 1", "1 1", "inf 1 1", "1 1 x"}) {
    EXPECT_NE(error({.spacing = spacing}), "") << spacing;
  }
  EXPECT_NE(error({.origin = "nan 0 0"}), "");
  EXPECT_NE(error({.direction = "1 0 0 1 0 0 0 0 1"}), "");
}

TEST(Vti, CountsThatLieAreRefused) {
  // The array tells 24 bytes; the extent makes more, or fewer.
  for (const char* extent : {"0 3 0 2 0 2", "0 3 0 2 0 0", "0 3 0 2 0 100"}) {
    for (const VtiForm form : kBinaryForms) {
      for (const bool compressed : {false, true}) {
        const VtiFields fields{.form = form, .compressed = compressed, .extent = extent};
        EXPECT_FALSE(import_bytes(vti(fields, kSmallSamples)).imported()) << extent;
      }
    }
  }
}

// The XML library takes a time that grows with the square of a comment's length.
TEST(Vti, EndlessCommentsAreRefused) {
  const std::string file = vti({}, kSmallSamples);
  const std::size_t behind = file.find('>', file.find("<VTKFile")) + 1;
  const auto with_comment = [&](std::size_t bytes) {
    return file.substr(0, behind) + "<!--" + std::string(bytes, 'x') + "-->" + file.substr(behind);
  };
  EXPECT_EQ(import_bytes(with_comment(100'000)).error, "");
  EXPECT_THAT(import_bytes(with_comment(3'000'000)).error, HasSubstr("a tag or a comment of more"));
}

TEST(Vti, EntitiesAreRefused) {
  const std::string file = "<?xml version=\"1.0\"?>\n<!DOCTYPE VTKFile [<!ENTITY a \"b\">]>\n" +
                           vti({}, kSmallSamples).substr(22);
  EXPECT_THAT(import_bytes(file).error, HasSubstr("entity"));
}

}  // namespace
}  // namespace isomesh::import::test
