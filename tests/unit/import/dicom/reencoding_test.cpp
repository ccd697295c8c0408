// The same objects as dcmtk's tools write them again: in other syntaxes, compressed without loss,
// and plain again. Every one of them gives the same volume to the bit.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/process.h"
#include "tests/unit/import/dicom/mosaics.h"
#include "tests/unit/import/dicom/segments.h"

namespace isomesh::import::test {
namespace {

// Commands that follow one another, each without its two files.
using Commands = std::vector<std::vector<std::string>>;

struct Reencoding {
  const char* name;
  Commands commands;
  bool is_compressed = false;  // for which single bits are not made
};

std::string reencoded(const std::string& file, const Commands& commands) {
  const Folder folder;
  std::filesystem::path from = folder.write("0", file);
  for (std::size_t step = 0; step < commands.size(); ++step) {
    const std::filesystem::path to = folder.path(std::to_string(step + 1));
    std::vector<std::string> command = commands[step];
    command.push_back(from.string());
    command.push_back(to.string());
    const isomesh::test::Finished finished = isomesh::test::run(command);
    EXPECT_EQ(finished.status, 0) << command.front() << ": " << finished.errors;
    from = to;
  }
  return read_file(from);
}

NamedFiles reencoded(NamedFiles files, const Commands& commands) {
  for (auto& [name, bytes] : files) bytes = reencoded(bytes, commands);
  return files;
}

void expect_same_volume(const NamedFiles& files, const Commands& commands) {
  const Outcome plain = imported(import_objects(files));
  const Outcome again = imported(import_objects(reencoded(files, commands)));
  EXPECT_EQ(again.canonical, plain.canonical);
}

DicomSeries series_of(unsigned allocated, unsigned stored, bool is_signed) {
  return {.columns = 16,
          .rows = 12,
          .slices = 3,
          .step = {0.5, -0.25, 2},
          .bits_allocated = allocated,
          .bits_stored = stored,
          .high_bit = stored - 1,
          .is_signed = is_signed};
}

class DicomReencoding : public testing::TestWithParam<Reencoding> {};

TEST_P(DicomReencoding, OfSlicesKeepsTheVolume) {
  for (const auto& [allocated, stored, is_signed] :
       {std::tuple{8U, 8U, false}, std::tuple{16U, 12U, false}, std::tuple{16U, 16U, false},
        std::tuple{16U, 16U, true}}) {
    SCOPED_TRACE(std::to_string(stored) + (is_signed ? " signed" : " unsigned"));
    expect_same_volume(series_of(allocated, stored, is_signed).files(), GetParam().commands);
  }
}

TEST_P(DicomReencoding, OfFramesKeepsTheVolume) {
  const DicomSeries series = series_of(16, 12, false);
  expect_same_volume({{"one", series.enhanced({2, 0, 1}).file()}}, GetParam().commands);
}

TEST_P(DicomReencoding, OfMosaicsKeepsTheVolume) {
  expect_same_volume({{"one", siemens_mosaic().file()}}, GetParam().commands);
  expect_same_volume({{"one", united_imaging_grid().file()}}, GetParam().commands);
}

TEST_P(DicomReencoding, OfSegmentationsKeepsTheVolume) {
  if (GetParam().is_compressed) return;  // dcmtk compresses no single bits
  expect_same_volume({{"one", segmentation(two_segments()).file()}}, GetParam().commands);
}

INSTANTIATE_TEST_SUITE_P(
    By, DicomReencoding,
    testing::Values(Reencoding{"Implicit", {{"dcmconv", "+ti"}}},
                    Reencoding{"Explicit", {{"dcmconv", "+te"}}},
                    Reencoding{"BigEndian", {{"dcmconv", "+tb"}}},
                    Reencoding{"Deflated", {{"dcmconv", "+td"}}},
                    Reencoding{"UndefinedLengths", {{"dcmconv", "+te", "-e"}}},
                    Reencoding{"ImplicitUndefinedLengths", {{"dcmconv", "+ti", "-e"}}},
                    Reencoding{"GroupLengths", {{"dcmconv", "+te", "+g", "+e"}}},
                    Reencoding{"Padding", {{"dcmconv", "+te", "+p", "512", "128"}}},
                    Reencoding{"WithoutMetaInformation", {{"dcmconv", "-F", "+ti"}}},
                    Reencoding{"BigEndianAndBack", {{"dcmconv", "+tb"}, {"dcmconv", "+ti"}}},
                    Reencoding{"Rle", {{"dcmcrle"}}, true},
                    Reencoding{"RleInFragments", {{"dcmcrle", "+fs", "1"}}, true},
                    Reencoding{"RleWithoutTable", {{"dcmcrle", "-ot"}}, true},
                    Reencoding{"RleAndBack", {{"dcmcrle"}, {"dcmdrle"}}, true},
                    Reencoding{"JpegLossless", {{"dcmcjpeg", "+el"}}, true},
                    Reencoding{"JpegLosslessSv1", {{"dcmcjpeg", "+e1"}}, true},
                    Reencoding{"JpegLosslessInFragments", {{"dcmcjpeg", "+e1", "+fs", "1"}}, true},
                    Reencoding{"JpegLosslessAndBack", {{"dcmcjpeg", "+e1"}, {"dcmdjpeg"}}, true},
                    Reencoding{"JpegLs", {{"dcmcjpls", "+el"}}, true},
                    Reencoding{"JpegLsInFragments", {{"dcmcjpls", "+el", "+fs", "1"}}, true},
                    Reencoding{"JpegLsAndBack", {{"dcmcjpls", "+el"}, {"dcmdjpls", "+te"}}, true}),
    [](const auto& each) { return std::string(each.param.name); });

}  // namespace
}  // namespace isomesh::import::test
