// One volume, whatever it comes in.

#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/import/files.h"
#include "tests/unit/import/other_writers.h"
#include "tests/unit/import/vti_writer.h"
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
  const Outcome raw = imported(import_raw_bytes(bytes_of(same.samples), same.description()));
  ASSERT_EQ(raw.canonical.size(), kHeaderBytes + 48);
  for (const std::string& file :
       {same.as_nifti(false), same.as_nifti(true), gzip(same.as_nifti(false)), same.as_nrrd(false),
        same.as_nrrd(true), same.as_metaimage()}) {
    const Outcome outcome = imported(import_bytes(file));
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

// A file that says how far apart its samples are refuses another spacing; one that does not takes
// it.
struct Spaced {
  std::string name;
  std::string none;
  Vector3 assumed;               // without a spacing; zeros: it must be given
  std::vector<std::string> own;  // files with a spacing
};

TEST(Formats, TakeASpacingIfTheyHaveNone) {
  const std::string samples(kSmallSamples);
  const Lines plain =
      with(with(with(small_nrrd(), "space", ""), "space directions", ""), "space origin", "");
  // The steps of this matrix are not of length 1, which the given spacing replaces.
  const Lines meta =
      with(with(small_metaimage(), "ElementSpacing", ""), "TransformMatrix", "2 0 0 0 1 0 0 0 1");
  const std::string points = "POINT_DATA 24\nSCALARS s char\nLOOKUP_TABLE default\n" + samples;
  const auto without = [](std::string file, const std::string& part) {
    return file.erase(file.find(part), part.size());
  };
  const std::string image = vti({.spacing = "7 8 9"}, samples);
  const Spaced rows[] = {
      {"nrrd",
       nrrd(plain, samples),
       {1, 1, 1},
       {nrrd(small_nrrd(), samples), nrrd(with(plain, "spacings", "1 1 1"), samples),
        nrrd(with(with(plain, "axis mins", "0 0 0"), "axis maxs", "4 3 2"), samples)}},
      {"metaimage",
       metaimage(meta, samples),
       {2, 1, 1},
       {metaimage(with(meta, "ElementSpacing", "1 1 1"), samples),
        metaimage(with(meta, "ElementSize", "1 1 1"), samples)}},
      {"vti", without(image, " Spacing=\"7 8 9\""), {1, 1, 1}, {image}},
      {"vtk",
       without(vtk_legacy(false, points), "\nSPACING 1 2 3"),
       {1, 1, 1},
       {vtk_legacy(false, points)}},
      {"numpy", npy(npy_header("|u1", false, "(2, 3, 4)"), samples), {}, {}},
      {"mrc", mrc({.cell = {0, 0, 0}}, samples), {}, {mrc({}, samples)}},
      {"tiff", tiff({samples.substr(12), samples.substr(12)}), {}, {}}};
  const ImportOptions spaced = {.spacing = Vector3{1, 2, 3}};
  const auto is_unknown = testing::Contains("unit-unknown");
  for (const auto& [name, none, assumed, own] : rows) {
    SCOPED_TRACE(name);
    const Outcome alone = import_bytes(none);
    if (assumed == Vector3{}) {
      ASSERT_EQ(alone.remedy.choices.size(), 1);
      EXPECT_EQ(alone.remedy.choices[0].parameter, "spacing");
      EXPECT_THAT(alone.error, HasSubstr("spacing=X,Y,Z"));
    } else {
      EXPECT_EQ(alone.volume.geometry.spacing, assumed);
      EXPECT_THAT(codes_of(alone), is_unknown);
      EXPECT_THAT(alone.volume.notes.back().detail, HasSubstr("spacing=X,Y,Z"));
    }
    const Outcome given = imported(import_bytes(none, {}, spaced));
    EXPECT_EQ(given.volume.geometry.spacing, (Vector3{1, 2, 3}));
    EXPECT_THAT(codes_of(given), testing::Not(is_unknown));
    for (const std::string& file : own) {
      EXPECT_EQ(import_bytes(file, {}, spaced).code, ErrorCode::kInvalidParameter);
      EXPECT_THAT(codes_of(import_bytes(file)), testing::Not(is_unknown));
    }
  }
  // The centres of cells lie half a step behind the origin.
  std::string cells = "CELL_DATA 12\nSCALARS s char\nLOOKUP_TABLE default\n" + samples.substr(12);
  cells = without(vtk_legacy(false, cells, "4 3 3"), "\nSPACING 1 2 3");
  EXPECT_EQ(import_bytes(cells, {}, spaced).volume.geometry.origin, (Vector3{10.5, 21, 31.5}));
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
