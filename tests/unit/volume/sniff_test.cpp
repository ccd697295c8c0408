#include "server/volume/sniff.h"

#include <gtest/gtest.h>

#include "server/volume/dicom/tags.h"
#include "tests/unit/volume/dicom/objects.h"
#include "tests/unit/volume/writers.h"

namespace isomesh::volume::test {
namespace {

std::optional<FileFormat> sniffed(std::string_view bytes) {
  return sniff(std::as_bytes(std::span(bytes.substr(0, kSniffBytes))));
}

TEST(Sniff, KnowsNiftiInBothVersionsAndByteOrders) {
  for (const int version : {1, 2}) {
    for (const bool big_endian : {false, true}) {
      const std::string file = nifti({.version = version, .big_endian = big_endian}, kSmallSamples);
      EXPECT_EQ(sniffed(file), FileFormat::kNifti);
      EXPECT_EQ(sniffed(gzip(file)), FileFormat::kNifti);
    }
  }
}

TEST(Sniff, KnowsNrrdAndMetaImage) {
  EXPECT_EQ(sniffed(nrrd(small_nrrd(), kSmallSamples)), FileFormat::kNrrd);
  EXPECT_EQ(sniffed(gzip(nrrd(small_nrrd(), kSmallSamples))), FileFormat::kNrrd);
  EXPECT_EQ(sniffed(metaimage(small_metaimage(), kSmallSamples)), FileFormat::kMetaImage);
  EXPECT_EQ(sniffed("NDims = 3\nDimSize = 1 1 1\n"), FileFormat::kMetaImage);
  EXPECT_EQ(sniffed("NDims=3\r\nDimSize = 1 1 1\r\n"), FileFormat::kMetaImage);
}

TEST(Sniff, KnowsDicom) { EXPECT_EQ(sniffed(std::string(128, '\0') + "DICM"), FileFormat::kDicom); }

TEST(Sniff, KnowsDicomWithoutPreambleByItsFirstElements) {
  const DicomObject slice = DicomSeries{}.slice(0);
  for (const std::string_view syntax : {kExplicit, kImplicit}) {
    EXPECT_EQ(sniffed(slice.bare(syntax)), FileFormat::kDicom) << syntax;
    EXPECT_EQ(sniffed(slice.file(syntax).substr(132)), FileFormat::kDicom) << syntax;
    const std::string bare = slice.bare(syntax);
    for (std::size_t bytes = 0; bytes < 20; ++bytes) {
      EXPECT_EQ(sniffed(bare.substr(0, bytes)), std::nullopt) << syntax << ' ' << bytes;
    }
    DicomObject other = slice;
    other.text(dicom::kSopClassUid, "UI", "1.2.3");
    EXPECT_EQ(sniffed(other.bare(syntax)), std::nullopt) << syntax;
    other.erase(dicom::kSopClassUid);
    EXPECT_EQ(sniffed(other.bare(syntax)), std::nullopt) << syntax;
    other = slice;
    other.text(0x00070010, "LO", "in front");
    EXPECT_EQ(sniffed(other.bare(syntax)), std::nullopt) << syntax;
  }
}

TEST(Sniff, KnowsNothingElse) {
  EXPECT_EQ(sniffed(""), std::nullopt);
  EXPECT_EQ(sniffed("\x1f\x8b\x08"), std::nullopt);
  EXPECT_EQ(sniffed(gzip("plain text")), std::nullopt);
  EXPECT_EQ(sniffed("NRRD0009\n"), std::nullopt);
  EXPECT_EQ(sniffed("NDims: 3\n"), std::nullopt);
  EXPECT_EQ(sniffed("name = value\n"), std::nullopt);
  EXPECT_EQ(sniffed(std::string(4096, '\0')), std::nullopt);
  EXPECT_EQ(sniffed(nifti({.magic = "none"}, kSmallSamples)), std::nullopt);
}

TEST(Sniff, TellsTheNamesOfTheApi) {
  EXPECT_EQ(to_string(FileFormat::kNifti), "nifti");
  EXPECT_EQ(to_string(FileFormat::kNrrd), "nrrd");
  EXPECT_EQ(to_string(FileFormat::kMetaImage), "metaimage");
}

}  // namespace
}  // namespace isomesh::volume::test
