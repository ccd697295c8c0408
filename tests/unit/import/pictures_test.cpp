// Stacks of pictures whose pixels are not plain samples: indices, bits, colours that are grey.
#include "tests/unit/import/pictures.h"

#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/import/images/palettes.h"
#include "tests/unit/import/archives.h"
#include "tests/unit/import/files.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using namespace std::string_literals;
using testing::ElementsAre;
using testing::HasSubstr;

using Writer = std::function<std::string(const PictureFields&, const std::string&)>;
using Bytes = std::vector<std::uint8_t>;

const std::vector<std::pair<const char*, Writer>> kWriters = {
    {"png", png_picture}, {"bmp", bmp_picture}, {"tiff", [](const auto& fields, const auto& rows) {
                                                   return tiff_picture(fields, {rows});
                                                 }}};

// Two pictures as a stack.
Outcome stack(const std::string& one, const std::string& other) {
  return import_bytes(zip({{"1", one}, {"2", other}}), {},
                      {.spacing = std::array<double, 3>{1, 1, 1}});
}

const PictureFields kLabels = {
    .width = 3, .height = 2, .palette = {{0, 0, 0}, {255, 0, 0}, {0, 128, 0}, {1, 2, 3}}};

TEST(Pictures, IndicesAreSamplesAndColoursThoseOfLabels) {
  for (const auto& [name, write] : kWriters) {
    const Outcome outcome = stack(write(kLabels, "\0\1\1\0\2\2"s), write(kLabels, "\0\0\1\0\0\2"s));
    ASSERT_EQ(outcome.error, "") << name;
    EXPECT_EQ(outcome.volume.format, name);
    EXPECT_EQ(outcome.sample_bytes(), "\0\1\1\0\2\2\0\0\1\0\0\2"s) << name;
    EXPECT_THAT(outcome.volume.labels, ElementsAre(LabelEntry{.label = 1, .color = "#ff0000"},
                                                   LabelEntry{.label = 2, .color = "#008000"}))
        << name;
  }
}

TEST(Pictures, PagesOfATiffHaveOnePalette) {
  const Outcome outcome = import_bytes(tiff_picture(kLabels, {"\0\1\1\0\2\2"s, "\0\0\1\0\0\2"s}),
                                       {}, {.spacing = std::array<double, 3>{1, 1, 1}});
  ASSERT_EQ(outcome.error, "");
  EXPECT_EQ(outcome.volume.labels.size(), 2);
}

// The samples are no longer the indices then.
TEST(Pictures, ColoursOfCalibratedIndicesAreNotThoseOfLabels) {
  PictureFields fields = kLabels;
  fields.description = "ImageJ=1.53t\nimages=2\nslices=2\ncf=0\nc0=0\nc1=2\n";
  const Outcome outcome = import_bytes(tiff_picture(fields, {"\0\1\1\0\2\2"s, "\0\0\1\0\0\2"s}), {},
                                       {.spacing = std::array<double, 3>{1, 1, 1}});
  ASSERT_EQ(outcome.error, "");
  EXPECT_EQ(outcome.volume.range[1], 4);
  EXPECT_EQ(outcome.volume.labels.size(), 0);
}

TEST(Pictures, PalettesMayDifferOnlyInUnusedColours) {
  PictureFields other = kLabels;
  other.palette = {{0, 0, 0}, {255, 0, 0}};
  const Outcome same =
      stack(png_picture(kLabels, "\0\1\1\0\2\2"s), png_picture(other, "\0\0\1\0\0\1"s));
  ASSERT_EQ(same.error, "");
  EXPECT_EQ(same.volume.labels.size(), 2);
  other.palette[1] = {0, 0, 255};
  EXPECT_THAT(
      stack(png_picture(kLabels, "\0\1\1\0\2\2"s), png_picture(other, "\0\0\1\0\0\1"s)).error,
      HasSubstr("index 1 is #ff0000 in one page, and #0000ff in another"));
  EXPECT_THAT(stack(png_picture(kLabels, "\0\1\1\0\2\2"s),
                    png_picture({.width = 3, .height = 2}, "\0\0\1\0\0\1"s))
                  .error,
              HasSubstr("others are grey"));
}

// A grey palette is a way to store greys, and each page may have its own.
TEST(Pictures, GreyPalettesAreGreyPictures) {
  for (const auto& [name, write] : kWriters) {
    PictureFields one = {
        .width = 3, .height = 2, .palette = {{9, 9, 9}, {0, 0, 0}, {200, 200, 200}}};
    PictureFields other = one;
    other.palette = {{200, 200, 200}, {9, 9, 9}, {0, 0, 0}};
    const Outcome outcome = stack(write(one, "\0\1\2\0\1\2"s), write(other, "\0\1\2\0\1\2"s));
    ASSERT_EQ(outcome.error, "") << name;
    EXPECT_EQ(samples_of<std::uint8_t>(outcome),
              (Bytes{9, 0, 200, 9, 0, 200, 200, 9, 0, 200, 9, 0}))
        << name;
    EXPECT_TRUE(outcome.volume.labels.empty()) << name;
  }
}

TEST(Pictures, IndicesBeyondThePaletteAreTold) {
  PictureFields grey = {.width = 3, .height = 2, .palette = {{9, 9, 9}, {200, 200, 200}}};
  const Outcome black =
      stack(png_picture(grey, "\0\1\5\0\1\0"s), png_picture(grey, "\0\1\0\0\7\1"s));
  ASSERT_EQ(black.error, "");
  EXPECT_EQ(samples_of<std::uint8_t>(black), (Bytes{9, 200, 0, 9, 200, 9, 9, 200, 9, 9, 0, 200}));
  EXPECT_THAT(black.volume.notes.at(1).detail, HasSubstr("2 samples have an index beyond"));
  EXPECT_EQ(black.volume.notes.at(1).code, "header-corrected");
  const std::string second = png_picture(kLabels, "\0\0\1\0\0\2"s);
  const Outcome labels = stack(png_picture(kLabels, "\0\1\1\0\2\7"s), second);
  ASSERT_EQ(labels.error, "");
  EXPECT_EQ(labels.sample_bytes(), "\0\1\1\0\2\7\0\0\1\0\0\2"s);
  EXPECT_THAT(labels.volume.labels.back(), (LabelEntry{.label = 7}));
  EXPECT_THAT(labels.volume.notes.at(1).detail, HasSubstr("1 sample has an index beyond"));
  EXPECT_THAT(codes_of(stack(second, second)), testing::Not(testing::Contains("header-corrected")));
}

TEST(Pictures, OnlyUnsignedIntegersAreIndices) {
  const auto error = [](PictureFields fields, std::uint16_t format, std::size_t bytes) {
    fields.format = format;
    const std::string page = tiff_picture(fields, {std::string(6 * bytes, '\1')});
    return stack(page, page).error;
  };
  PictureFields wide = kLabels;
  wide.bits = 16;
  EXPECT_EQ(error(wide, 1, 2), "");
  for (const auto& each : {error(kLabels, 2, 1), error(wide, 2, 2), error(wide, 3, 2)}) {
    EXPECT_THAT(each, HasSubstr("no indices"));
  }
}

// Each palette costs the flags of all indices, however few its colours are.
TEST(Pictures, ManyPalettesAreRefused) {
  constexpr std::size_t kMostPalettes = (std::size_t{1} << 23) / 256;
  Palettes palettes;
  PageLayout layout = {1, 1, StoredType::kUint8};
  for (std::size_t at = 0; at < kMostPalettes; ++at) {
    layout.palette = at % 2 == 0 ? std::vector<Colour>{{0, 0, 0}} : std::vector<Colour>{{1, 0, 0}};
    ASSERT_NO_THROW(palettes.begin(layout)) << at;
  }
  layout.palette = {{0, 1, 0}};
  EXPECT_THROW(palettes.begin(layout), Error);
}

// Pseudo-colours of a picture with many values are no labels.
TEST(Pictures, ManyColoursNeedFlatRegions) {
  PictureFields fields = {.width = 20, .height = 20, .palette = {}};
  for (int at = 0; at < 256; ++at) fields.palette.push_back({static_cast<std::uint8_t>(at), 0, 0});
  std::string noise;
  std::string flat;
  for (int at = 0; at < 400; ++at) {
    noise += static_cast<char>(at * 37 % 251);
    flat += static_cast<char>(at % 20 < 2 ? 0 : at / 20 + 1);
  }
  const Outcome picture = stack(png_picture(fields, noise), png_picture(fields, noise));
  EXPECT_EQ(picture.sample_bytes(), noise + noise);
  EXPECT_TRUE(picture.volume.labels.empty());
  const Outcome labels = stack(png_picture(fields, flat), png_picture(fields, flat));
  EXPECT_EQ(labels.volume.labels.size(), 20);
}

TEST(Pictures, PackedBitsAreNotScaled) {
  // Three pixels of 1, 2 or 4 bits in a row, the first in the highest bits.
  const std::vector<std::pair<std::uint16_t, std::string>> rows = {
      {1, "\x40\xa0"}, {2, "\x1c\xe4"}, {4, "\x01\xf0\x2f\x70"}};
  const std::vector<Bytes> right = {{0, 1, 0, 1, 0, 1}, {0, 1, 3, 3, 2, 1}, {0, 1, 15, 2, 15, 7}};
  for (std::size_t at = 0; at < rows.size(); ++at) {
    const auto& [bits, bytes] = rows[at];
    PictureFields fields = {.width = 3, .height = 2, .bits = bits};
    Bytes twice = right[at];
    twice.insert(twice.end(), right[at].begin(), right[at].end());
    for (const auto& [name, write] : kWriters) {
      if (name == "bmp"s) continue;  // always has a palette
      EXPECT_EQ(samples_of<std::uint8_t>(stack(write(fields, bytes), write(fields, bytes))), twice)
          << name << bits;
    }
    for (int index = 0; index < 1 << bits; ++index) {
      fields.palette.push_back({static_cast<std::uint8_t>(index), 0, 0});
    }
    for (const auto& [name, write] : kWriters) {
      if (name == "bmp"s && bits == 2) continue;
      EXPECT_EQ(samples_of<std::uint8_t>(stack(write(fields, bytes), write(fields, bytes))), twice)
          << name << bits;
    }
  }
}

// As tifffile writes masks: 0 is said to be white, and bits are stored as they are.
TEST(Pictures, TiffsAreNotInverted) {
  const PictureFields fields = {.width = 3, .height = 2, .bits = 1, .photometric = 0};
  const std::string page = tiff_picture(fields, {"\x40\xa0"});
  EXPECT_EQ(samples_of<std::uint8_t>(stack(page, page)),
            (Bytes{0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1}));
}

TEST(Pictures, ColoursThatAreGreyAreRead) {
  for (const auto& [name, write] : kWriters) {
    PictureFields fields = {.width = 2, .height = 2, .components = 3};
    std::string rows = "aaabbbcccddd";
    Outcome outcome = stack(write(fields, rows), write(fields, rows));
    ASSERT_EQ(outcome.error, "") << name;
    EXPECT_EQ(outcome.sample_bytes(), "abcdabcd") << name;
    rows[4] = 'x';
    EXPECT_THAT(stack(write(fields, rows), write(fields, rows)).error,
                AllOf(HasSubstr("Convert it to grey"), HasSubstr("indexed picture")))
        << name;
    fields.components = 4;
    fields.has_opacity = true;
    rows =
        "aaa\xff"s
        "bbb\xff"
        "ccc\xff"
        "ddd\xff";
    outcome = stack(write(fields, rows), write(fields, rows));
    EXPECT_EQ(outcome.sample_bytes(), "abcdabcd") << name << outcome.error;
    rows[3] = '\x10';
    EXPECT_THAT(stack(write(fields, rows), write(fields, rows)).error, HasSubstr("alpha channel"))
        << name;
  }
}

TEST(Pictures, GreyWithAnOpacityAndWideColoursAreRead) {
  PictureFields fields = {.width = 2, .height = 2, .components = 2, .has_opacity = true};
  const std::string grey =
      "a\xff"s
      "b\xff"
      "c\xff"
      "d\xff";
  EXPECT_EQ(stack(png_picture(fields, grey), png_picture(fields, grey)).sample_bytes(), "abcdabcd");
  const std::string tiff = tiff_picture(fields, {grey});
  EXPECT_EQ(stack(tiff, tiff).sample_bytes(), "abcdabcd");
  fields = {.width = 2, .height = 2, .bits = 16, .components = 3};
  const std::vector<std::uint16_t> values = {1, 1, 1, 300, 300, 300, 65535, 65535, 65535, 7, 7, 7};
  const std::vector<std::uint16_t> right = {1, 300, 65535, 7, 1, 300, 65535, 7};
  const std::string big = png_picture(fields, bytes_of(values, true));
  EXPECT_EQ(samples_of<std::uint16_t>(stack(big, big)), right);
  const std::string little = tiff_picture(fields, {bytes_of(values)});
  EXPECT_EQ(samples_of<std::uint16_t>(stack(little, little)), right);
}

// The fourth byte of a BMP without masks means nothing.
TEST(Pictures, FourthBytesOfABitmapAreIgnored) {
  const PictureFields fields = {.width = 2, .height = 2, .components = 4};
  const std::string picture = bmp_picture(fields, "aaa\0bbb\0ccc\1ddd\0"s);
  EXPECT_EQ(stack(picture, picture).sample_bytes(), "abcdabcd");
}

TEST(Pictures, WideIntegersAndHalfFloatsOfTiffAreRead) {
  PictureFields fields = {.width = 2, .height = 2, .bits = 64, .format = 2};
  const std::vector<std::int64_t> numbers = {-5, 0, 7, 1000};
  std::string page = tiff_picture(fields, {bytes_of(numbers)});
  EXPECT_EQ(samples_of<std::int16_t>(stack(page, page)),
            (std::vector<std::int16_t>{-5, 0, 7, 1000, -5, 0, 7, 1000}));
  fields.format = 1;
  page = tiff_picture(fields, {bytes_of(std::vector<std::uint64_t>{5, 0, 7, 200})});
  EXPECT_EQ(samples_of<std::uint8_t>(stack(page, page)), (Bytes{5, 0, 7, 200, 5, 0, 7, 200}));
  fields = {.width = 2, .height = 2, .bits = 16, .format = 3};
  page = tiff_picture(fields, {bytes_of(std::vector<std::uint16_t>{0x3c00, 0xc100, 0x0001, 0})});
  EXPECT_EQ(samples_of<float>(stack(page, page)),
            (std::vector<float>{1, -2.5F, 0x1p-24F, 0, 1, -2.5F, 0x1p-24F, 0}));
}

}  // namespace
}  // namespace isomesh::import::test
