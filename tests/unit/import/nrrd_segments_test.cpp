// The segments that 3D Slicer tells of in NRRD headers.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/import/files.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

// A key of a segment, without "Segment" before it.
using Key = std::pair<std::string, std::string>;

std::string with_segments(const Lines& lines, const std::vector<Key>& keys,
                          std::string_view samples) {
  std::string file = nrrd(lines, samples);
  std::string text;
  for (const auto& [key, value] : keys) text += "Segment" + key + ":=" + value + '\n';
  return file.insert(file.find("\n\n") + 1, text);
}

Lines layered(const std::string& sizes, const std::string& kinds, const std::string& directions) {
  Lines lines = with(with(small_nrrd(), "dimension", "4"), "sizes", sizes);
  return with(with(lines, "kinds", kinds), "space directions", directions);
}

// Two layers of 2 x 2 x 2 samples, the layers first.
Lines layers_first(const std::string& sizes = "2 2 2 2", const std::string& kind = "list") {
  return layered(sizes, kind + " domain domain domain", "none (1,0,0) (0,1,0) (0,0,1)");
}

LabelEntry entry(std::int64_t label, const std::string& name,
                 std::vector<std::int64_t> values = {}) {
  return {.label = label, .name = name, .color = {}, .values = std::move(values)};
}

Outcome described(const Outcome& outcome, const std::array<std::uint32_t, 3>& dims = {2, 2, 2}) {
  return without_ends(imported(outcome), {0, 0, 0}, dims);
}

// Each sample is one of both segments in its layer.
const std::vector<Key> kTwoLayers = {{"0_Name", "liver"},  {"0_LabelValue", "1"}, {"0_Layer", "0"},
                                     {"1_Name", "tumour"}, {"1_LabelValue", "1"}, {"1_Layer", "1"}};

TEST(NrrdSegments, HaveNamesAndColors) {
  const std::string samples(24, '\3');
  const Outcome outcome = imported(import_bytes(with_segments(small_nrrd(),
                                                              {{"0_ID", "a"},
                                                               {"0_Name", "M\xc3\xbcller \x01"},
                                                               {"0_LabelValue", "7"},
                                                               {"0_Color", "1 0.5 0"},
                                                               {"0_Layer", "0"},
                                                               {"1_Name", "spleen"},
                                                               {"1_LabelValue", "3"},
                                                               {"1_Color", "red"}},
                                                              samples)));
  EXPECT_EQ(described(outcome, {4, 3, 2}).sample_bytes(), samples);
  EXPECT_THAT(outcome.volume.labels,
              ElementsAre(entry(3, "spleen"), LabelEntry{.label = 7,
                                                         .name = "M\xc3\xbcller \xef\xbf\xbd",
                                                         .color = "#ff8000"}));
  // Also where samples do not look as if.
  EXPECT_THAT(codes_of(outcome), Contains("looks-like-labels"));
  EXPECT_THAT(outcome.volume.notes.back().detail, HasSubstr("2 labels. Use \"labels\": \"all\""));
}

TEST(NrrdSegments, OfFractionsAreNoLabels) {
  const Outcome outcome = imported(
      import_bytes(with_segments(with(with(small_nrrd(), "type", "float"), "endian", "little"),
                                 {{"0_Name", "liver"}}, bytes_of(some_samples<float>(24)))));
  EXPECT_THAT(outcome.volume.labels, IsEmpty());
  EXPECT_THAT(codes_of(outcome), Not(Contains("looks-like-labels")));
}

TEST(NrrdSegments, InLayersMayOverlap) {
  // Sample 0 is in the first segment alone, sample 1 in the second alone, and sample 2 in both.
  std::string first(8, '\0');
  std::string second(8, '\0');
  first[0] = first[2] = second[1] = second[2] = '\1';
  std::string interleaved;
  for (std::size_t at = 0; at < 8; ++at) interleaved += std::string{first[at], second[at]};
  const Outcome outcome =
      imported(import_bytes(with_segments(layers_first(), kTwoLayers, interleaved)));
  EXPECT_EQ(outcome.volume.type, SampleType::kUint8);
  // The tumour's value is the liver's in another layer, so that it gets another number.
  EXPECT_THAT(samples_of<std::uint8_t>(described(outcome)), ElementsAre(1, 2, 3, 0, 0, 0, 0, 0));
  EXPECT_THAT(outcome.volume.labels,
              ElementsAre(entry(1, "liver", {1, 3}), entry(2, "tumour", {2, 3})));
  ASSERT_THAT(codes_of(outcome),
              ElementsAre("overlapping-segments", "empty-planes", "looks-like-labels"));
  EXPECT_EQ(outcome.volume.notes[0].detail,
            "1 sample belongs to several segments. 1 value stands for their combinations.");
  EXPECT_EQ(outcome.volume.range, (std::array<double, 2>{0, 3}));

  const Outcome packed = import_bytes(
      with_segments(with(layers_first(), "encoding", "gzip"), kTwoLayers, gzip(interleaved)));
  EXPECT_EQ(packed.canonical, outcome.canonical);
  const Outcome planar = import_bytes(
      with_segments(layered("2 2 2 2", "domain domain domain list", "(1,0,0) (0,1,0) (0,0,1) none"),
                    kTwoLayers, first + second));
  EXPECT_EQ(planar.canonical, outcome.canonical);
  EXPECT_EQ(planar.volume.labels, outcome.volume.labels);

  const Outcome chosen = imported(
      import_bytes(with_segments(layers_first(), kTwoLayers, interleaved), {}, {.volume = 1}));
  EXPECT_EQ(described(chosen).sample_bytes(), second);
  EXPECT_THAT(chosen.volume.labels, ElementsAre(entry(1, "tumour")));
}

TEST(NrrdSegments, ThatDoNotOverlapKeepTheirNumbers) {
  std::string samples(16, '\0');
  samples[0] = '\7';
  samples[3] = '\2';
  std::vector<Key> keys = kTwoLayers;
  keys[1].second = "7";
  keys[4].second = "2";
  const Outcome outcome = imported(import_bytes(with_segments(layers_first(), keys, samples)));
  EXPECT_THAT(samples_of<std::uint8_t>(described(outcome)), ElementsAre(7, 2, 0, 0, 0, 0, 0, 0));
  EXPECT_THAT(outcome.volume.labels, ElementsAre(entry(2, "tumour"), entry(7, "liver")));
  EXPECT_THAT(codes_of(outcome), ElementsAre("empty-planes", "looks-like-labels"));
}

// Versions before 5.0 have a layer for each segment, and do not say so.
TEST(NrrdSegments, OfOldVersionsAreALayerEach) {
  std::string samples(16, '\0');
  samples[0] = samples[1] = '\1';
  const Outcome outcome = imported(import_bytes(with_segments(
      layers_first("2 2 2 2", "vector"), {{"0_Name", "liver"}, {"1_Name", "tumour"}}, samples)));
  EXPECT_THAT(outcome.volume.labels, ElementsAre(entry(1, "liver", {3}), entry(2, "tumour", {3})));
}

TEST(NrrdSegments, ValuesOfNoSegmentAreLabelsWithoutAName) {
  std::string samples(16, '\0');
  samples[0] = '\1';
  samples[2] = '\5';
  const Outcome outcome =
      imported(import_bytes(with_segments(layers_first(), kTwoLayers, samples)));
  EXPECT_THAT(samples_of<std::uint8_t>(described(outcome)), ElementsAre(1, 3, 0, 0, 0, 0, 0, 0));
  EXPECT_THAT(outcome.volume.labels,
              ElementsAre(entry(1, "liver"), entry(2, "tumour"), entry(3, "")));
}

// --- MITK's --------------------------------------------------------------------------------------

std::string of_mitk(const Lines& lines, const std::string& groups, std::string_view samples) {
  std::string file = nrrd(lines, samples);
  return file.insert(file.find("\n\n") + 1,
                     "modality:=org.mitk.multilabel.segmentation\n"
                     "org.mitk.multilabel.segmentation.labelgroups:=" +
                         groups + '\n');
}

TEST(NrrdSegments, OfMitkHaveNamesAndColors) {
  const std::string groups =
      R"([{"labels": [{"value": 2, "name": "liver", "color": {"type": "ColorProperty", )"
      R"("value": [1, 0, 0]}}, {"value": 5, "name": "tumour", "color": [0, 0.5, 0]}, )"
      R"({"value": 0, "name": "none"}, {"value": -1}, {"value": 7}, 8]}])";
  const std::string samples(24, '\5');
  const Outcome outcome = imported(import_bytes(of_mitk(small_nrrd(), groups, samples)));
  EXPECT_EQ(outcome.sample_bytes(), samples);
  EXPECT_THAT(outcome.volume.labels,
              ElementsAre(LabelEntry{.label = 2, .name = "liver", .color = "#ff0000"},
                          LabelEntry{.label = 5, .name = "tumour", .color = "#008000"},
                          LabelEntry{.label = 7}));
}

// The format writes a backslash twice; some writers do not.
TEST(NrrdSegments, OfMitkMayHaveEscapes) {
  for (const std::string name : {R"(a \"b\" \u00fc)", R"(a \\"b\\" \\u00fc)"}) {
    const std::string groups = R"([{"labels": [{"value": 1, "name": ")" + name + R"("}]}])";
    const Outcome outcome =
        imported(import_bytes(of_mitk(small_nrrd(), groups, std::string(24, '\1'))));
    EXPECT_THAT(outcome.volume.labels, ElementsAre(entry(1, "a \"b\" \xc3\xbc"))) << name;
  }
}

TEST(NrrdSegments, OfMitksGroupsMayOverlap) {
  const std::string groups = R"([{"labels": [{"value": 1, "name": "liver"}]}, )"
                             R"({"name": "x", "labels": [{"value": 2, "name": "tumour"}]}])";
  const std::string samples("\1\0\1\2\0\2\0\0\0\0\0\0\0\0\0\0", 16);
  const Lines lines = layers_first("2 2 2 2", "vector");
  const Outcome outcome = imported(import_bytes(of_mitk(lines, groups, samples)));
  EXPECT_THAT(outcome.volume.labels,
              ElementsAre(entry(1, "liver", {1, 3}), entry(2, "tumour", {2, 3})));
  EXPECT_THAT(samples_of<std::uint8_t>(outcome), ElementsAre(1, 3, 2, 0, 0, 0, 0, 0));
  const Outcome second = imported(import_bytes(of_mitk(lines, groups, samples), {}, {.volume = 1}));
  EXPECT_THAT(second.volume.labels, ElementsAre(entry(2, "tumour")));
  EXPECT_THAT(samples_of<std::uint8_t>(second), ElementsAre(0, 2, 2, 0, 0, 0, 0, 0));
}

TEST(NrrdSegments, OfMitkThatAreDamagedAreNone) {
  const std::string deep(100'000, '[');
  for (const std::string& groups : {std::string("[{"), std::string("{}"), std::string("[1, {}]"),
                                    std::string(R"([{"labels": null}])"), deep}) {
    const Outcome outcome =
        imported(import_bytes(of_mitk(small_nrrd(), groups, std::string(24, '\1'))));
    EXPECT_THAT(outcome.volume.labels, testing::IsEmpty());
    EXPECT_THAT(codes_of(outcome), ElementsAre("looks-like-labels"));
  }
}

// Nine segments of which every combination is somewhere.
TEST(NrrdSegments, WithManyCombinationsHaveWiderValues) {
  std::string samples;
  std::vector<Key> keys;
  for (int combination = 0; combination < 512; ++combination) {
    for (int layer = 0; layer < 9; ++layer) {
      samples += static_cast<char>(combination >> layer & 1);
    }
  }
  for (int layer = 0; layer < 9; ++layer) {
    keys.emplace_back(std::to_string(layer) + "_Layer", std::to_string(layer));
  }
  const Outcome outcome =
      imported(import_bytes(with_segments(layers_first("9 8 8 8"), keys, samples)));
  EXPECT_EQ(outcome.volume.type, SampleType::kUint16);
  const auto values = samples_of<std::uint16_t>(described(outcome, {8, 8, 8}));
  ASSERT_EQ(outcome.volume.labels.size(), 9U);
  for (std::size_t at = 0; at < values.size(); ++at) {
    for (std::size_t layer = 0; layer < 9; ++layer) {
      const LabelEntry& label = outcome.volume.labels[layer];
      EXPECT_EQ(std::ranges::binary_search(label.values, std::int64_t{values[at]}),
                (at >> layer & 1) == 1)
          << at << ' ' << layer;
    }
  }
}

// The first and the last sample of each axis belong to the segment, or none does.
TEST(NrrdSegments, AreClosedWhereTheyTouchTheEnd) {
  const std::vector<Key> keys = {{"0_Name", "liver"}, {"0_LabelValue", "1"}, {"0_Layer", "0"}};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const std::size_t side : {0, 1}) {
      // 5 x 5 x 5 samples with one label, at the middle of a side.
      std::array<std::size_t, 3> place = {2, 2, 2};
      place[axis] = side * 4;
      std::string samples(125, '\0');
      samples[place[0] + 5 * place[1] + 25 * place[2]] = '\1';
      const std::string file = with_segments(with(small_nrrd(), "sizes", "5 5 5"), keys, samples);
      const Outcome outcome = imported(import_bytes(file));
      std::array<std::uint32_t, 3> dims = {5, 5, 5};
      dims[axis] = 6;
      EXPECT_EQ(outcome.volume.dims, dims);
      std::array<double, 3> origin = {};
      if (side == 0) origin[axis] = -1;
      EXPECT_EQ(outcome.volume.geometry.origin, origin);
      EXPECT_EQ(described(outcome, {5, 5, 5}).sample_bytes(), samples);
      EXPECT_THAT(codes_of(outcome), Contains("empty-planes"));
      // Without segments it is a scan, whose border shows nothing of what lies beyond.
      const Outcome scan =
          imported(import_bytes(nrrd(with(small_nrrd(), "sizes", "5 5 5"), samples)));
      EXPECT_EQ(scan.sample_bytes(), samples);
    }
  }
  std::string samples(125, '\0');
  samples[62] = '\1';
  const Outcome inside =
      imported(import_bytes(with_segments(with(small_nrrd(), "sizes", "5 5 5"), keys, samples)));
  EXPECT_EQ(inside.sample_bytes(), samples);
  EXPECT_THAT(codes_of(inside), Not(Contains("empty-planes")));
}

TEST(NrrdSegments, MayHaveOneSlice) {
  const std::vector<Key> keys = {{"0_Name", "liver"}, {"0_LabelValue", "1"}, {"0_Layer", "0"}};
  std::string samples(12, '\0');
  samples[5] = '\1';
  Lines lines = with(small_nrrd(), "sizes", "4 3 1");
  lines = with(lines, "space directions", "(1,0,0) (0,1,0) (0,0,2.5)");
  const Outcome outcome = imported(import_bytes(with_segments(lines, keys, samples)));
  EXPECT_EQ(outcome.volume.dims, (std::array<std::uint32_t, 3>{4, 3, 3}));
  EXPECT_EQ(outcome.volume.geometry.origin, (std::array<double, 3>{0, 0, -2.5}));
  EXPECT_EQ(outcome.volume.geometry.spacing[2], 2.5);
  EXPECT_EQ(described(outcome, {4, 3, 1}).sample_bytes(), samples);
  EXPECT_THAT(import_bytes(nrrd(lines, samples)).error, HasSubstr("1 slice"));
  // The same in two layers.
  const Outcome two = imported(import_bytes(with_segments(
      layered("2 4 3 1", "list domain domain domain", "none (1,0,0) (0,1,0) (0,0,2.5)"), kTwoLayers,
      std::string(10, '\0') + '\1' + std::string(13, '\0'))));
  EXPECT_EQ(two.canonical, outcome.canonical);
}

// Room for the planes is taken before it is known which are needed. A flat file would take thrice
// its size.
TEST(NrrdSegments, AreLimitedWithTheirEnds) {
  const std::vector<Key> keys = {{"0_Name", "liver"}, {"0_LabelValue", "1"}, {"0_Layer", "0"}};
  const std::string file = with_segments(small_nrrd(), keys, std::string(24, '\1'));
  EXPECT_EQ(import_bytes(file, {.max_sample_bytes = 6 * 5 * 4}).error, "");
  EXPECT_EQ(import_bytes(file, {.max_sample_bytes = 6 * 5 * 4 - 1}).code, ErrorCode::kTooLarge);
  // Larger than any number of samples along an axis.
  const Outcome endless = import_bytes(
      with_segments(with(with(small_nrrd(), "sizes", "4294967295 1 1"), "encoding", "gzip"), keys,
                    gzip(std::string(10, '\0'))));
  EXPECT_FALSE(endless.imported());
}

// Seventeen independent segments are more than 16 bits tell apart.
TEST(NrrdSegments, WithTooManyCombinationsAreRefused) {
  std::string samples(std::size_t{17} << 17, '\0');
  for (std::size_t at = 0; at < samples.size(); ++at) {
    samples[at] = static_cast<char>(at / 17 >> at % 17 & 1);
  }
  const Outcome outcome =
      import_bytes(with_segments(layers_first("17 64 64 32"), {{"0_Layer", "0"}}, samples));
  EXPECT_EQ(outcome.code, ErrorCode::kUnusableVolume);
  EXPECT_THAT(outcome.error, HasSubstr("need more than the 65535 values"));
}

TEST(NrrdSegments, OfNonsenseAreRefused) {
  const std::string samples(16, '\0');
  EXPECT_THAT(import_bytes(with_segments(layers_first(), {{"0_Layer", "2"}}, samples)).error,
              HasSubstr("segment 0 is in layer 2, but the file has 2 layers"));
  EXPECT_THAT(import_bytes(with_segments(layers_first(), {{"0_Layer", "x"}}, samples)).error,
              HasSubstr("Segment0_Layer"));
  EXPECT_THAT(import_bytes(with_segments(layers_first(), {{"0_LabelValue", "1.5"}}, samples)).error,
              HasSubstr("Segment0_LabelValue"));
}

TEST(NrrdSegments, AreClosedWhateverTheirTypeIs) {
  const std::vector<Key> keys = {{"0_Name", "liver"}, {"0_LabelValue", "1"}, {"0_Layer", "0"}};
  const std::vector<std::uint8_t> bytes = {1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1,
                                           0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
  const auto of = [&]<class Number>(const char* type, Number far) {
    std::vector<Number> samples(bytes.begin(), bytes.end());
    samples[0] = far;
    Lines lines = with(small_nrrd(), "type", type);
    lines.emplace_back("endian", "little");
    return imported(import_bytes(with_segments(lines, keys, bytes_of(samples))));
  };
  const Outcome expected = of("uint8", std::uint8_t{1});
  EXPECT_THAT(codes_of(expected), Contains("empty-planes"));
  EXPECT_EQ(of("int64", std::int64_t{1}).canonical, expected.canonical);
  EXPECT_EQ(of("uint64", std::uint64_t{1}).canonical, expected.canonical);
  EXPECT_EQ(of("float", 1.0F).canonical, expected.canonical);
  const Outcome wide = of("int64", std::int64_t{1} << 40);
  EXPECT_EQ(wide.volume.dims, expected.volume.dims);
  EXPECT_THAT(codes_of(wide), Contains("empty-planes"));
  EXPECT_THAT(wide.volume.labels,
              ElementsAre(entry(1, "liver", {1}), entry(std::int64_t{1} << 40, "", {2})));
  // Fractions are no labels, and stay as they are.
  const Outcome fractions = of("float", 0.5F);
  EXPECT_EQ(fractions.volume.dims, (std::array<std::uint32_t, 3>{4, 3, 2}));
  EXPECT_EQ(fractions.volume.type, SampleType::kFloat32);
  EXPECT_EQ(fractions.sample_bytes().size(), 96);
}

// Far from the origin, single precision has no room for another plane.
TEST(NrrdSegments, AreRefusedIfTheirEndsCannotBeClosed) {
  const std::vector<Key> keys = {{"0_Name", "liver"}, {"0_LabelValue", "1"}, {"0_Layer", "0"}};
  std::string samples(24, '\0');
  samples[15] = '\1';
  std::size_t refused = 0;
  for (int x = 65'528; x < 65'540; ++x) {
    const Lines lines = with(small_nrrd(), "space origin", '(' + std::to_string(x) + ",0,0)");
    if (!import_bytes(nrrd(lines, samples)).imported()) continue;
    const Outcome outcome = import_bytes(with_segments(lines, keys, samples));
    if (outcome.imported()) continue;
    ++refused;
    EXPECT_THAT(outcome.error, HasSubstr("cannot be closed at its ends"));
  }
  EXPECT_EQ(refused, 1);
}

}  // namespace
}  // namespace isomesh::import::test
