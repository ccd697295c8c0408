// The palettes of label maps, which are their labels' colours.
#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/import/dicom/elements/tags.h"
#include "tests/unit/import/dicom/segments.h"

namespace isomesh::import::test {
namespace {

using namespace dicom;
using testing::ElementsAre;
using testing::Optional;

using Words = std::vector<unsigned>;

std::string words(const Words& numbers) {
  std::string bytes;
  for (const unsigned number : numbers) {
    bytes += {static_cast<char>(number & 0xFF), static_cast<char>(number >> 8)};
  }
  return bytes;
}

struct TestPalette {
  unsigned count = 4;
  unsigned first = 0;
  unsigned bits = 16;
  std::array<std::string, 3> data;
  bool is_segmented = false;
  std::vector<std::array<unsigned, 3>> colors = {};  // of the first segments
};

std::vector<std::optional<std::string>> colors_of(const TestPalette& palette,
                                                  std::string_view syntax = kExplicit) {
  SegmentObject what = {.frames = {{.z = 0, .labels = {2}}, {.z = 1, .labels = {3}}},
                        .segments = {"a", "b", "c"},
                        .type = "LABELMAP",
                        .colors = palette.colors};
  DicomObject object = segmentation(what);
  object.text(kPhotometricInterpretation, "CS", "PALETTE COLOR");
  const Tag first_data = palette.is_segmented ? kSegmentedRedPaletteData : kRedPaletteData;
  for (unsigned color = 0; color < 3; ++color) {
    object.numbers(kRedPaletteDescriptor + color, {palette.count, palette.first, palette.bits});
    object.bytes(first_data + color, "OW", palette.data[color]);
  }
  const Outcome outcome = imported(import_objects({{"seg", object.file(syntax)}}));
  std::vector<std::optional<std::string>> colors;
  for (const LabelEntry& label : outcome.volume.labels) colors.push_back(label.color);
  return colors;
}

auto are(const std::string& a, const std::string& b, const std::string& c) {
  return ElementsAre(Optional(a), Optional(b), Optional(c));
}

TEST(DicomPalette, GivesLabelsTheirColors) {
  const TestPalette wide = {
      .data = {words({0, 0xFFFF, 0, 0}), words({0, 0, 0x8000, 0}), words({0, 0, 0, 0xFFFF})}};
  for (const std::string_view syntax : {kImplicit, kExplicit}) {
    EXPECT_THAT(colors_of(wide, syntax), are("#ff0000", "#008000", "#0000ff")) << syntax;
  }
  // Bytes, two to a word, or one.
  TestPalette bytes = {.bits = 8,
                       .data = {words({0xFF00, 0}), words({0, 0x80}), words({0, 0xFF00})}};
  for (const std::string_view syntax : {kImplicit, kExplicit}) {
    EXPECT_THAT(colors_of(bytes, syntax), are("#ff0000", "#008000", "#0000ff")) << syntax;
  }
  bytes.data = {words({0, 0xFF, 0, 0}), words({0, 0, 0x80, 0}), words({0, 0, 0, 0xFF})};
  EXPECT_THAT(colors_of(bytes), are("#ff0000", "#008000", "#0000ff"));
  // The first entry is that of label 2, and of all below. All above have the last one's.
  const TestPalette part = {
      .count = 1, .first = 2, .data = {words({0xFFFF}), words({0}), words({0xFFFF})}};
  EXPECT_THAT(colors_of(part), are("#ff00ff", "#ff00ff", "#ff00ff"));
}

TEST(DicomPalette, MayBeLong) {
  Words ramp(65536);
  for (unsigned at = 0; at < ramp.size(); ++at) ramp[at] = at == 2 ? 0xFFFF : 0;
  const std::string data = words(ramp);
  EXPECT_THAT(colors_of({.count = 0, .data = {data, data, data}}),
              are("#000000", "#ffffff", "#000000"));
}

TEST(DicomPalette, MayBeInSegments) {
  // Discrete: 0. Linear: three entries up to full. So label 1 has a third, and 3 all.
  const std::string ramp = words({0, 1, 0, 1, 3, 0xFFFF});
  // Discrete: 0, full. Then the first segment again.
  const std::string again = words({0, 2, 0, 0xFFFF, 2, 1, 0, 0});
  const std::string none = words({0, 4, 0, 0, 0, 0});
  EXPECT_THAT(colors_of({.data = {ramp, again, none}, .is_segmented = true}),
              are("#55ff00", "#aa0000", "#ffff00"));
  const std::string bytes({0, 1, 0, 1, 3, '\xFF'});
  EXPECT_THAT(colors_of({.bits = 8, .data = {bytes, bytes, bytes}, .is_segmented = true}),
              are("#555555", "#aaaaaa", "#ffffff"));
}

TEST(DicomPalette, GivesWayToTheValueOfASegment) {
  // L* 100, a* and b* 0: white.
  const TestPalette palette = {
      .data = {words({0, 0xFFFF, 0, 0}), words({0, 0, 0xFFFF, 0}), words({0, 0, 0, 0xFFFF})},
      .colors = {{0xFFFF, 0x8080, 0x8080}}};
  EXPECT_THAT(colors_of(palette), are("#ffffff", "#00ff00", "#0000ff"));
}

TEST(DicomPalette, ThatIsDamagedIsIgnored) {
  const std::string four = words({0, 0, 0, 0});
  const auto none = ElementsAre(std::nullopt, std::nullopt, std::nullopt);
  EXPECT_THAT(colors_of({.count = 5, .data = {four, four, four}}), none);
  EXPECT_THAT(colors_of({.bits = 12, .data = {four, four, four}}), none);
  EXPECT_THAT(colors_of({.data = {four, four, ""}}), none);
  for (const Words& numbers :
       {Words{0}, Words{0, 9, 1}, Words{1, 4, 1}, Words{2, 1, 0, 0}, Words{0, 1, 0, 2, 9, 6, 0},
        Words{0, 1, 0, 2, 1, 6, 0}, Words{0, 1, 0, 2, 1, 999, 0}, Words{3, 1, 0},
        Words{0, 0, 0, 1, 65535, 0, 2, 65535, 0, 0}}) {
    const std::string data = words(numbers);
    EXPECT_THAT(colors_of({.data = {data, data, data}, .is_segmented = true}), none);
  }
}

}  // namespace
}  // namespace isomesh::import::test
