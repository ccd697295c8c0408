// Images of ITK and MINC 2 in HDF5.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/import/files.h"
#include "tests/unit/import/hdf5_writer.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using testing::HasSubstr;
using Vector = std::array<double, 3>;
using Dims = std::array<std::uint32_t, 3>;

Hdf5Image some_image() { return {.samples = some_samples<std::int16_t>(24)}; }

TEST(Hdf5, ReadsAnImageOfItk) {
  Hdf5Image image = some_image();
  for (const bool is_chunked : {false, true}) {
    image.is_chunked = is_chunked;
    const Outcome outcome = imported(import_bytes(itk_hdf5(image)));
    EXPECT_EQ(outcome.volume.format, "hdf5");
    EXPECT_EQ(outcome.volume.dims, (Dims{4, 3, 2}));
    EXPECT_EQ(samples_of<std::int16_t>(outcome), image.samples);
    const Geometry& geometry = outcome.volume.geometry;
    EXPECT_EQ(geometry.origin, (Vector{5, 6, 7}));
    EXPECT_EQ(geometry.spacing, (Vector{1, 2, 3}));
    EXPECT_EQ(geometry.direction, (std::array<double, 9>{0, 1, 0, -1, 0, 0, 0, 0, 1}));
  }
}

TEST(Hdf5, MincIsRasWithRealValuesOfEachSlice) {
  Hdf5Image image;
  for (std::int16_t at = 0; at < 24; ++at)
    image.samples.push_back(static_cast<std::int16_t>(at * 10 - 120));
  const Outcome outcome = imported(import_bytes(minc({}, image)));
  EXPECT_EQ(outcome.volume.geometry.origin, (Vector{-5, -6, 7}));
  EXPECT_EQ(outcome.volume.geometry.spacing, (Vector{1, 2, 3}));
  EXPECT_EQ(outcome.volume.geometry.direction, (std::array<double, 9>{1, 0, 0, 0, -1, 0, 0, 0, 1}));
  const std::vector<float> samples = samples_of<float>(outcome);
  EXPECT_FLOAT_EQ(samples[0], -10);   // clamped to the valid range
  EXPECT_FLOAT_EQ(samples[4], -8);    // -80 of -100 to 100 is -8 of -10 to 10
  EXPECT_FLOAT_EQ(samples[12], 100);  // 0 of -100 to 100 is 100 of 0 to 200
}

TEST(Hdf5, MincStaysWholeIfItsRangeChangesNothing) {
  const Hdf5Image image = some_image();
  const MincFields same = {.order = "xspace,zspace,yspace",
                           .sizes = {2, 3, 4},
                           .valid_range = {-32768, 32767},
                           .least = {-32768, -32768},
                           .most = {32767, 32767}};
  const Outcome outcome = imported(import_bytes(minc(same, image)));
  EXPECT_EQ(samples_of<std::int16_t>(outcome), image.samples);
  // The fastest axis is y, the slowest is x.
  EXPECT_EQ(outcome.volume.geometry.direction, (std::array<double, 9>{0, 0, 1, -1, 0, 0, 0, 1, 0}));
}

TEST(Hdf5, MincHasUnits) {
  const Outcome micrometres = imported(import_bytes(minc({.units = "um"}, some_image())));
  EXPECT_EQ(micrometres.volume.geometry.spacing, (Vector{0.001, 0.002, 0.003}));
  EXPECT_EQ(micrometres.volume.geometry.origin, (Vector{-0.005, -0.006, 0.007}));
  const Outcome pixels = import_bytes(minc({.units = "pixel"}, some_image()));
  EXPECT_EQ(pixels.volume.geometry.spacing, (Vector{1, 2, 3}));
  EXPECT_THAT(codes_of(pixels), testing::ElementsAre("unit-unknown"));
  EXPECT_THAT(import_bytes(minc({.units = "furlong"}, some_image())).error,
              HasSubstr("unit of length \"furlong\" is unknown"));
}

TEST(Hdf5, AnInstantIsChosen) {
  const Hdf5Image image = some_image();
  const MincFields series = {.order = "time,zspace,yspace,xspace",
                             .sizes = {2, 2, 2, 3},
                             .valid_range = {-32768, 32767},
                             .least = {-32768, -32768},
                             .most = {32767, 32767}};
  EXPECT_EQ(import_bytes(minc(series, image)).remedy.choices.size(), 2);
  const Outcome second = import_bytes(minc(series, image), {}, {.volume = 1});
  const std::vector<std::int16_t> half(image.samples.begin() + 12, image.samples.end());
  EXPECT_EQ(samples_of<std::int16_t>(second), half);
}

TEST(Hdf5, OtherProgramsAreNamed) {
  const Outcome outcome = import_bytes(imaris());
  EXPECT_EQ(outcome.code, ErrorCode::kUnsupportedMedia);
  EXPECT_THAT(outcome.error, HasSubstr("This is an Imaris file"));
  EXPECT_THAT(import_bytes(minc({.order = "zspace,yspace,zspace"}, some_image())).error,
              HasSubstr("other dimensions"));
  EXPECT_THAT(import_bytes(minc({.least = {0, 0, 0}, .most = {1, 1, 1}}, some_image())).error,
              HasSubstr("do not fit"));
}

// Changed bytes may crash the library, which is why the process that reads is confined.
TEST(Hdf5, TruncationIsRefused) {
  const std::string file = itk_hdf5(some_image());
  for (std::size_t size = 8; size < file.size(); size += 97) {
    const Outcome outcome = import_bytes(file.substr(0, size));
    EXPECT_FALSE(outcome.imported()) << size;
    EXPECT_NE(outcome.code, ErrorCode::kInternal) << outcome.error;
  }
}

}  // namespace
}  // namespace isomesh::import::test
