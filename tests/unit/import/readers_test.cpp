#include "server/import/readers.h"

#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/volume_formats.h"
#include "server/import/dicom/elements/tags.h"
#include "tests/unit/import/dicom/objects.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

// The name of the format that the bytes are told for; empty for none.
std::string_view sniffed(std::string_view bytes) {
  const Reader* reader = sniff(bytes.substr(0, kSniffBytes));
  return reader == nullptr ? std::string_view{} : reader->name;
}

// The tests of the formats read files of all kinds.
TEST(Readers, KnowMetaImageByItsFirstLine) {
  EXPECT_EQ(sniffed("NDims = 3\nDimSize = 1 1 1\n"), "metaimage");
  EXPECT_EQ(sniffed("NDims=3\r\nDimSize = 1 1 1\r\n"), "metaimage");
}

TEST(Readers, KnowDicomByFourLettersInTheirPlace) {
  EXPECT_EQ(sniffed(std::string(128, '\0') + "DICM"), "dicom");
  EXPECT_EQ(sniffed(std::string(128, '\0') + "DIC"), "");
  EXPECT_EQ(sniffed(std::string(127, '\0') + "DICM"), "");
}

// Its preamble may be the header of another format (PS3.10, 7.1).
TEST(Readers, KnowDicomWhosePreambleIsOfAnImage) {
  for (const std::string_view image :
       {std::string_view("II*\0\x08\0\0\0", 8), std::string_view("MM\0*\0\0\0\x08", 8)}) {
    std::string file(128, '\0');
    file.replace(0, image.size(), image);
    EXPECT_EQ(sniffed(file), "tiff");
    EXPECT_EQ(sniffed(file + "DICM"), "dicom");
  }
}

TEST(Readers, KnowDicomWithoutPreambleByItsFirstElements) {
  const DicomObject slice = DicomSeries{}.slice(0);
  for (const std::string_view syntax : {kExplicit, kImplicit}) {
    EXPECT_EQ(sniffed(slice.bare(syntax)), "dicom") << syntax;
    EXPECT_EQ(sniffed(slice.file(syntax).substr(132)), "dicom") << syntax;
    const std::string bare = slice.bare(syntax);
    for (std::size_t bytes = 0; bytes < 20; ++bytes) {
      EXPECT_EQ(sniffed(bare.substr(0, bytes)), "") << syntax << ' ' << bytes;
    }
    DicomObject other = slice;
    other.text(dicom::kSopClassUid, "UI", "1.2.3");
    EXPECT_EQ(sniffed(other.bare(syntax)), "") << syntax;
    other.erase(dicom::kSopClassUid);
    EXPECT_EQ(sniffed(other.bare(syntax)), "") << syntax;
    other = slice;
    other.text(0x00070010, "LO", "in front");
    EXPECT_EQ(sniffed(other.bare(syntax)), "") << syntax;
  }
}

TEST(Readers, KnowNothingElse) {
  EXPECT_EQ(sniffed(""), "");
  EXPECT_EQ(sniffed("\x1f\x8b\x08"), "");
  EXPECT_EQ(sniffed(gzip("plain text")), "");
  EXPECT_EQ(sniffed("NRRD0009\n"), "");
  EXPECT_EQ(sniffed("NDims: 3\n"), "");
  EXPECT_EQ(sniffed("name = value\n"), "");
  EXPECT_EQ(sniffed(std::string(4096, '\0')), "");
  EXPECT_EQ(sniffed(nifti({.magic = "none"}, kSmallSamples)), "");
}

TEST(Readers, EachHasANameOfItsOwnAndReads) {
  std::set<std::string_view> names;
  for (const Reader* reader : readers()) {
    EXPECT_TRUE(names.insert(reader->name).second) << reader->name;
    EXPECT_NE(reader->parse == nullptr, reader->describe == nullptr) << reader->name;
    EXPECT_EQ(reader->sniff == nullptr, reader->name == "raw") << reader->name;
  }
}

TEST(Readers, AreNamedWhereNoneReadsAFile) {
  const Outcome outcome = import_bytes("plain text");
  EXPECT_EQ(outcome.code, ErrorCode::kUnsupportedMedia);
  EXPECT_THAT(outcome.error, testing::StartsWith("The file is not NIfTI, NRRD, "));
  EXPECT_THAT(
      outcome.error,
      testing::EndsWith(
          ", or a ZIP or TAR of one. If it holds raw samples, give their dims (X,Y,Z) and type."));
  for (const VolumeFormat& format : volume_formats()) {
    if (format.name == "raw") continue;
    EXPECT_THAT(outcome.error, testing::HasSubstr(std::string(format.title)));
  }
}

TEST(Readers, AreThoseOfTheTableOfFormats) {
  std::set<std::string_view> names;
  for (const Reader* reader : readers()) names.insert(reader->name);
  names.erase("archive");
  for (const VolumeFormat& format : volume_formats()) {
    EXPECT_EQ(names.erase(format.name), 1) << format.name;
    EXPECT_FALSE(format.title.empty() || format.suffixes.empty() || format.content.empty())
        << format.name;
  }
  EXPECT_THAT(names, testing::IsEmpty());
}

TEST(Readers, NameFilesOfOtherPrograms) {
  EXPECT_THAT(import_bytes("ZISRAWFILE and more").error,
              testing::StartsWith("This is a CZI file of Zeiss, which cannot be read."));
  const std::string bzip2 = import_bytes("BZh91AY and more").error;
  EXPECT_THAT(bzip2, testing::StartsWith("This is a file compressed with bzip2, which cannot be "
                                         "read. Formats that can be read: "));
  EXPECT_THAT(bzip2, testing::EndsWith("or a ZIP or TAR of one, also compressed with gzip."));
  EXPECT_THAT(import_bytes("\xff\xd8\xff and more").error, testing::HasSubstr("a JPEG image"));
}

}  // namespace
}  // namespace isomesh::import::test
