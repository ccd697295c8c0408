// One volume, whatever it comes in.

#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/import/files.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using ::testing::HasSubstr;

// 4 x 3 x 2 int16, oblique axes, as every format tells it.
struct SameVolume {
  std::vector<std::int16_t> samples = some_samples<std::int16_t>(24);

  std::string as_nifti(bool big_endian) const {
    return nifti({.big_endian = big_endian,
                  .datatype = 4,
                  .bitpix = 16,
                  .pixdim = {1, 0.5, 1.25, 3, 0, 0, 0, 0},
                  .srow = {0, -1.25, 0, -8, -0.5, 0, 0, 16.5, 0, 0, -3, 2}},
                 bytes_of(samples, big_endian));
  }
  std::string as_nrrd(bool ras) const {
    Lines lines = with(with(small_nrrd(), "type", "short"), "endian", "big");
    lines = with(lines, "space", ras ? "RAS" : "LPS");
    lines = with(lines, "space directions",
                 ras ? "(0,-0.5,0) (-1.25,0,0) (0,0,-3)" : "(0,0.5,0) (1.25,0,0) (0,0,-3)");
    lines = with(lines, "space origin", ras ? "(-8,16.5,2)" : "(8,-16.5,2)");
    return nrrd(with(lines, "encoding", "gzip"), gzip(bytes_of(samples, true)));
  }
  std::string as_metaimage() const {
    Lines lines = with(small_metaimage(), "ElementType", "MET_SHORT");
    lines = with(lines, "TransformMatrix", "0 1 0 1 0 0 0 0 -1");
    lines = with(lines, "Offset", "8 -16.5 2");
    lines = with(lines, "ElementSpacing", "0.5 1.25 3");
    return metaimage(with(lines, "CompressedData", "True"), zlib(bytes_of(samples)));
  }
  RawDescription description() const {
    RawDescription description;
    description.dims = {4, 3, 2};
    description.type = SampleType::kInt16;
    description.geometry = {.origin = {8, -16.5, 2},
                            .spacing = {0.5, 1.25, 3},
                            .direction = {0, 1, 0, 1, 0, 0, 0, 0, -1}};
    return description;
  }
};

TEST(Formats, GiveOneCanonicalFile) {
  const SameVolume same;
  const Outcome raw = import_raw_bytes(bytes_of(same.samples), same.description());
  ASSERT_EQ(raw.error, "");
  ASSERT_EQ(raw.canonical.size(), kHeaderBytes + 48);
  for (const std::string& file :
       {same.as_nifti(false), same.as_nifti(true), gzip(same.as_nifti(false)), same.as_nrrd(false),
        same.as_nrrd(true), same.as_metaimage()}) {
    const Outcome outcome = import_bytes(file);
    EXPECT_EQ(outcome.error, "");
    EXPECT_EQ(outcome.canonical, raw.canonical);
    EXPECT_EQ(outcome.volume.geometry, raw.volume.geometry);
    EXPECT_EQ(outcome.volume.range, raw.volume.range);
    EXPECT_EQ(outcome.volume.suggested_iso, raw.volume.suggested_iso);
  }
}

TEST(Formats, AreReadByManyThreadsAtOnce) {
  const SameVolume same;
  const std::string expected = import_bytes(same.as_metaimage()).canonical;
  const std::string bad = nrrd(with(small_nrrd(), "space directions", "nonsense"), kSmallSamples);
  std::vector<std::jthread> threads;
  threads.reserve(4);
  for (int thread = 0; thread < 4; ++thread) {
    threads.emplace_back([&] {
      for (int round = 0; round < 10; ++round) {
        EXPECT_EQ(import_bytes(same.as_nrrd(true)).canonical, expected);
        EXPECT_EQ(import_bytes(same.as_metaimage()).canonical, expected);
        EXPECT_FALSE(import_bytes(bad).imported());
      }
    });
  }
}

// In images_test.cpp and in dicom/ those of their formats.
TEST(Formats, RefuseFlatImages) {
  const std::string_view twelve = kSmallSamples.substr(0, 12);
  for (const std::string& file : {nifti({.dim = {3, 4, 3, 1, 1, 1, 1, 1}}, twelve),
                                  nifti({.dim = {2, 4, 3, 1, 1, 1, 1, 1}}, twelve),
                                  nrrd(with(small_nrrd(), "sizes", "4 3 1"), twelve),
                                  metaimage(with(small_metaimage(), "DimSize", "4 3 1"), twelve)}) {
    EXPECT_EQ(import_bytes(file).error,
              "The file is a flat image: it has 1 slice of 4 x 3 samples. A volume needs two "
              "slices or more, in one file, folder, ZIP or TAR.");
  }
  EXPECT_THAT(import_bytes(nifti({.dim = {3, 1, 4, 3, 1, 1, 1, 1}}, twelve)).error,
              HasSubstr("1 slice of 4 x 3 samples"));
}

}  // namespace
}  // namespace isomesh::import::test
