// Names of labels in a file of their own, beside the volume.
#include "server/import/labels/label_text.h"

#include <filesystem>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/import/labels/label_table.h"
#include "tests/unit/import/archives.h"
#include "tests/unit/import/files.h"
#include "tests/unit/import/other_writers.h"
#include "tests/unit/import/pictures.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

LabelEntry entry(std::int64_t label, std::string name, std::optional<std::string> color = {}) {
  return {.label = label, .name = std::move(name), .color = std::move(color)};
}

TEST(LabelText, IsThatOfFreeSurfer) {
  EXPECT_THAT(labels_of_text("#$Id: FreeSurferColorLUT.txt,v 1.10 $\n\n"
                             "#No. Label Name:                R   G   B   A\n"
                             "0   Unknown                     0   0   0   0\n"
                             "10  Left-Thalamus               0   118 14  0\r\n"
                             "3   3rd-Ventricle               204 182 142 0\n"),
              ElementsAre(entry(0, "Unknown", "#000000"), entry(10, "Left-Thalamus", "#00760e"),
                          entry(3, "3rd-Ventricle", "#ccb68e")));
}

TEST(LabelText, IsThatOfSlicerWithItsSpaces) {
  const std::string lines =
      "0 Background 0 0 0 0\n3 connective_tissue 111 184 210 255\n4 (none) 0 0 0 0\n";
  EXPECT_THAT(
      labels_of_text("# Color table file C:/x/Segmentation-label_ColorTable.ctbl\n"
                     "# 3 values\n" +
                     lines),
      ElementsAre(entry(0, "Background", "#000000"), entry(3, "connective tissue", "#6fb8d2")));
  EXPECT_EQ(labels_of_text(lines)[1].name, "connective_tissue");
}

TEST(LabelText, IsThatOfItkSnap) {
  EXPECT_THAT(labels_of_text("################################################\n"
                             "# ITK-SnAP Label Description File\n"
                             "# IDX   -R-  -G-  -B-  -A--  VIS MSH  LABEL\n"
                             "    0     0    0    0        0  0  0    \"Clear Label\"\n"
                             "  200   186  194  212      0.5  1  1    \"Deep R\"\n"),
              ElementsAre(entry(0, "Clear Label", "#000000"), entry(200, "Deep R", "#bac2d4")));
}

TEST(LabelText, IsThatOfFslEyes) {
  EXPECT_THAT(
      labels_of_text("1 0.93 0.2 0 Frontal Pole\n2 0 1 0.5 Insular Cortex\n"),
      ElementsAre(entry(1, "Frontal Pole", "#ed3300"), entry(2, "Insular Cortex", "#00ff80")));
  EXPECT_THAT(labels_of_text("1 255 0 0 255 liver"), ElementsAre(entry(1, "liver", "#ff0000")));
}

TEST(LabelText, IsPlainNumbersAndNames) {
  EXPECT_THAT(
      labels_of_text("\xef\xbb\xbf"
                     "0\tUnclassified\r\n1\tPontine tract (a part of MCP)\r\n-2 \"left 2\""),
      ElementsAre(entry(0, "Unclassified"), entry(1, "Pontine tract (a part of MCP)"),
                  entry(-2, "left 2")));
  EXPECT_THAT(labels_of_text("// organs\n% organs\n5 R\xe9gion"),
              ElementsAre(entry(5, "R\xef\xbf\xbdgion")));
}

// MRIcron's atlases number their regions twice.
TEST(LabelText, HasNoNumberBehindNamesThatDifferWithoutIt) {
  EXPECT_THAT(labels_of_text("1 Precentral_L 2001\n2 Precentral_R 2002\n"),
              ElementsAre(entry(1, "Precentral_L"), entry(2, "Precentral_R")));
  EXPECT_THAT(labels_of_text("1 Vertebra 1\n2 Vertebra 2\n"),
              ElementsAre(entry(1, "Vertebra 1"), entry(2, "Vertebra 2")));
}

TEST(LabelText, OfOtherTextIsNone) {
  for (const std::string text :
       {"", "# only a comment\n", "liver\n", "1\n", "1 liver\nspleen\n", "1 0 0 0\n0 1 0 0\n",
        "1 2 name\n", "1 300 0 0 name\n", "1 nan 0 0 name\n", "1.5 name\n", "1, name\n",
        "99999999999999999999 name\n", "0.1 0 0 0\n"}) {
    EXPECT_THAT(labels_of_text(text), IsEmpty()) << text;
  }
  EXPECT_THAT(labels_of_text(std::string("1 li\0ver\n", 9)), IsEmpty());
  EXPECT_THAT(labels_of_text("1 a\x1b[31m\n"), IsEmpty());
  std::string many;
  for (int at = 0; at < 65'536; ++at) many += std::to_string(at) + " a\n";
  EXPECT_THAT(labels_of_text(many), IsEmpty());
}

TEST(LabelText, IsJsonOfNumbersAndNames) {
  const auto organs = ElementsAre(entry(1, "spleen"), entry(2, "kidney_right"));
  for (
      const std::string text :
      {R"({"1": "spleen", "2": "kidney_right"})",
       R"({"labels": [{"labelValue": 2, "name": "kidney_right"}, {"labelValue": 1, "name": "spleen"}]})",
       R"({"name": "x", "labels": {"1": "spleen", "2": "kidney_right"}, "training": [{"a": 1}]})",
       "\xef\xbb\xbf \n{\"labels\": {\"spleen\": 1, \"kidney_right\": 2}}\n"}) {
    EXPECT_THAT(label_table(labels_of_text(text)), organs) << text;
  }
  EXPECT_THAT(labels_of_text(R"([{"labelValue": 7, "name": "liver", "color": [1, 0.5, 0]},
                                 {"name": "left", "labelValue": -9007199254740993}])"),
              ElementsAre(entry(7, "liver", "#ff8000"), entry(-9007199254740993, "left")));
}

TEST(LabelText, OfOtherJsonIsNone) {
  for (const std::string text :
       {"{", "{}", "[]", "[1]", "[[]]", "{\"labels\": 3}", "{\"threshold\": 1}",
        "{\"labels\": {\"liver\": 1.5}}", "{\"1\": \"\"}", "{\"a\": \"b\"}",
        "{\"labels\": {\"tumour\": [1, 2]}}", "{\"liver\": {\"volume\": 3}}",
        "{\"1\": \"a\\u0000b\"}", "{\"1\": \"R\xe9gion\"}",
        "{\"labels\": {\"liver\": 9223372036854775808}}", "[{\"labelValue\": 1}]",
        "[{\"name\": \"x\", \"labelValue\": true}]"}) {
    EXPECT_THAT(labels_of_text(text), IsEmpty()) << text;
  }
  EXPECT_THAT(labels_of_text(std::string(1'000'000, '[')), IsEmpty());
  EXPECT_THAT(labels_of_text(std::string("{\"1\": \"a\"}\0{\"2\": \"b\"}", 21)), IsEmpty());
  std::string many = "{";
  for (int at = 0; at < 65'536; ++at)
    many += (at == 0 ? "\"" : ",\"") + std::to_string(at) + "\":\"a\"";
  EXPECT_THAT(labels_of_text(many + '}'), IsEmpty());
  // Two names of one label: it has one of them.
  EXPECT_THAT(label_table(labels_of_text(R"({"labels": {"spleen": 1, "liver": 1}})")),
              ElementsAre(entry(1, "liver")));
}

// --- Beside a volume -----------------------------------------------------------------------------

constexpr std::string_view kTable = "1 liver 255 0 0 0\n5 spleen 0 0 255 0\n";

std::string label_volume() {
  std::string samples;
  for (const char value : {0, 1, 2, 5}) samples += std::string(12, value);
  return nifti({.dim = {3, 6, 2, 4, 1, 1, 1, 1}}, samples);
}

std::vector<LabelEntry> labels_in(const std::vector<Member>& members,
                                  const std::string& chosen = "") {
  const Outcome outcome = imported(import_bytes(zip(members), {}, {.member = chosen}));
  return outcome.volume.labels;
}

TEST(LabelsBeside, AreThoseOfTheTableInItsFolder) {
  const auto both = ElementsAre(entry(1, "liver", "#ff0000"), entry(5, "spleen", "#0000ff"));
  for (const std::string name : {"seg.nii.txt", "seg.lut", "Seg_labels.ctbl",
                                 "FreeSurferColorLUT.txt", "tables/labels.txt"}) {
    EXPECT_THAT(labels_in({{"a/seg.nii", label_volume()},
                           {"a/" + name, std::string(kTable)},
                           {"a/readme.txt", "Labels of the abdomen.\n"},
                           {"a/seg.png", std::string("\x89PNG\0", 5)}}),
                both)
        << name;
  }
  const Outcome outcome =
      import_bytes(tar({{"seg.nii.gz", gzip(label_volume())}, {"seg.txt", std::string(kTable)}}));
  EXPECT_THAT(outcome.volume.labels, both);
  ASSERT_THAT(codes_of(outcome), ElementsAre("looks-like-labels"));
  EXPECT_THAT(outcome.volume.notes[0].detail,
              HasSubstr("The names of the labels are from \"seg.txt\"."));
}

TEST(LabelsBeside, AreThoseOfAMask) {
  std::vector<float> samples(24, 0);
  samples[7] = samples[8] = 1;
  const std::vector<std::uint8_t> whole(samples.begin(), samples.end());
  const Member table = {"mask.txt", "1 liver\n"};
  EXPECT_THAT(labels_in({{"mask.nii", nifti({}, bytes_of(whole))}, table}), SizeIs(1));
  const std::string floats = nifti({.datatype = 16, .bitpix = 32}, bytes_of(samples));
  EXPECT_THAT(labels_in({{"mask.nii", floats}, table}), SizeIs(1));
}

// The samples alone do not look like labels: no two neighbours are equal.
TEST(LabelsBeside, MakeLabelsOfSamples) {
  std::vector<float> floats;
  for (int at = 0; at < 24; ++at) floats.push_back(static_cast<float>(at * 2 % 5));
  const std::vector<std::uint8_t> whole(floats.begin(), floats.end());
  floats[3] += 0.0005F;
  const Member table = {"x.txt", "1 liver\n2 spleen\n3 kidney\n"};
  const auto with_table = [&](const std::string& nifti_file) {
    return imported(import_bytes(zip({{"x.nii", nifti_file}, table})));
  };
  EXPECT_THAT(codes_of(import_bytes(nifti({}, bytes_of(whole)))), IsEmpty());
  const Outcome bytes = with_table(nifti({}, bytes_of(whole)));
  EXPECT_THAT(bytes.volume.labels, SizeIs(3));
  ASSERT_THAT(codes_of(bytes), ElementsAre("looks-like-labels"));
  EXPECT_THAT(bytes.volume.notes[0].detail,
              HasSubstr("it names 3 of the 4 different values other than 0"));
  const Outcome rounded = with_table(nifti({.datatype = 16, .bitpix = 32}, bytes_of(floats)));
  EXPECT_THAT(codes_of(rounded), ElementsAre("labels-rounded", "looks-like-labels"));
  EXPECT_THAT(rounded.volume.notes[1].detail, HasSubstr("float32 in the file, are now uint8"));
  EXPECT_EQ(rounded.volume.labels, bytes.volume.labels);
  EXPECT_EQ(rounded.canonical, bytes.canonical);
  EXPECT_EQ(rounded.volume.range, bytes.volume.range);
  EXPECT_EQ(rounded.volume.suggested_iso, bytes.volume.suggested_iso);
  EXPECT_EQ(rounded.volume.bytes, bytes.volume.bytes);
}

// A table beside an image, which may name each value of a byte, is not about the image.
TEST(LabelsBeside, DoNotMakeLabelsOfImages) {
  std::string all;
  for (int value = 0; value < 4096; ++value) all += std::to_string(value) + " x\n";
  const NiftiFields fields = {.dim = {3, 40, 20, 10, 1, 1, 1, 1}, .datatype = 4, .bitpix = 16};
  const auto is_image = [&](const std::vector<std::int16_t>& samples, const std::string& table) {
    const Outcome outcome = imported(
        import_bytes(zip({{"ct.nii", nifti(fields, bytes_of(samples))}, {"ct.txt", table}})));
    return outcome.volume.labels.empty() && codes_of(outcome).empty();
  };
  std::vector<std::int16_t> samples;
  for (int at = 0; at < 8000; ++at) samples.push_back(static_cast<std::int16_t>(at * 7 % 1000));
  EXPECT_TRUE(is_image(samples, all)) << "hundreds of values, no two neighbours alike";
  EXPECT_TRUE(is_image(samples, std::string(kTable))) << "few of the values have a name";
  for (std::size_t at = 0; at < samples.size(); ++at) {
    samples[at] = static_cast<std::int16_t>(at * 3 % 10);
  }
  samples[0] = -1;
  EXPECT_TRUE(is_image(samples, all)) << "a negative value";
  samples[0] = 0;
  EXPECT_FALSE(is_image(samples, all));
}

TEST(LabelsBeside, AreThoseOfAStackOfPictures) {
  const std::string picture = grey_png(4, std::string("\0\0\1\1\0\0\1\1\0\0\1\1", 12));
  const Outcome outcome = imported(
      import_bytes(zip({{"m/1.png", picture}, {"m/2.png", picture}, {"m/names.txt", "1 liver\n"}}),
                   {}, {.spacing = std::array<double, 3>{1, 1, 1}}));
  EXPECT_THAT(outcome.volume.labels, ElementsAre(entry(1, "liver")));
  EXPECT_THAT(outcome.volume.ignored, IsEmpty());
}

// The names of labels that the volume has already, but without names.
TEST(LabelsBeside, NameLabelsOf64BitsAndOfPalettes) {
  constexpr std::int64_t kId = 720575940618780781;
  std::vector<std::int64_t> ids(12, 0);
  ids.insert(ids.end(), 12, kId);
  ids.insert(ids.end(), 12, 3);
  const std::string wide =
      nifti({.dim = {3, 6, 2, 3, 1, 1, 1, 1}, .datatype = 1024, .bitpix = 64}, bytes_of(ids));
  EXPECT_THAT(labels_in({{"a.nii", wide}, {"a.txt", "720575940618780781 axon\n9 other\n"}}),
              ElementsAre(LabelEntry{.label = 3, .values = {1}},
                          LabelEntry{.label = kId, .name = "axon", .values = {2}}));

  const PictureFields fields = {
      .width = 3, .height = 2, .palette = {{0, 0, 0}, {255, 0, 0}, {0, 128, 0}}};
  const std::string picture = png_picture(fields, std::string("\0\1\1\0\2\2", 6));
  const Outcome pictures = imported(import_bytes(
      zip({{"m/1.png", picture}, {"m/2.png", picture}, {"m/names.txt", "1 liver 0 0 255 0\n"}}), {},
      {.spacing = std::array<double, 3>{1, 1, 1}}));
  EXPECT_THAT(pictures.volume.labels,
              ElementsAre(entry(1, "liver", "#ff0000"), entry(2, "", "#008000")));
  EXPECT_THAT(pictures.volume.ignored, IsEmpty());
}

// A large background makes regions of an image, too.
TEST(LabelsBeside, WithAnotherNameMakeLabelsOfFewValuesOnly) {
  std::string all;
  for (int value = 0; value < 256; ++value) all += std::to_string(value) + " x\n";
  std::string samples(8000, '\0');
  for (std::size_t at = 0; at < 4000; ++at) {
    samples[at] = static_cast<char>(at % 2 == 0 ? 0 : at / 2 % 100);
    if (at % 8 < 4) samples[at] = static_cast<char>(at / 8 % 100);
  }
  samples[799] = '\0';  // the first one, as NIfTI counts from the right and from the front
  const std::string volume = nifti({.dim = {3, 40, 20, 10, 1, 1, 1, 1}}, samples);
  EXPECT_THAT(codes_of(imported(import_bytes(zip({{"ct.nii", volume}, {"labels.txt", all}})))),
              IsEmpty());
  EXPECT_THAT(codes_of(imported(import_bytes(zip({{"ct.nii", volume}, {"ct.txt", all}})))),
              ElementsAre("looks-like-labels"));
}

TEST(LabelsBeside, KeepTheSuggestionWithoutSamplesThatAreNoNumbers) {
  std::vector<float> samples;
  for (int at = 0; at < 24; ++at) samples.push_back(static_cast<float>(at * 2 % 5));
  samples[4] = samples[9] = std::numeric_limits<float>::quiet_NaN();
  const std::string volume = nifti({.datatype = 16, .bitpix = 32}, bytes_of(samples));
  const Outcome labels =
      imported(import_bytes(zip({{"x.nii", volume}, {"x.txt", "1 liver\n2 spleen\n"}})));
  EXPECT_EQ(labels.volume.type, SampleType::kUint8);
  EXPECT_EQ(labels.volume.suggested_iso, imported(import_bytes(volume)).volume.suggested_iso);
}

TEST(LabelsBeside, OfOtherLabelsAreNotUsed) {
  const Outcome outcome =
      imported(import_bytes(zip({{"a.nii", label_volume()}, {"a.txt", "7 heart\n0 air\n"}})));
  EXPECT_THAT(outcome.volume.labels, IsEmpty());
  ASSERT_THAT(outcome.volume.ignored, SizeIs(1));
  EXPECT_EQ(outcome.volume.ignored[0].name, "a.txt");
  EXPECT_THAT(outcome.volume.ignored[0].reason, HasSubstr("were not used"));
  EXPECT_THAT(outcome.volume.notes[0].detail,
              HasSubstr("The table \"a.txt\" names none of the labels, so it was not used."));
}

TEST(LabelsBeside, AreNotThoseOfAnotherVolume) {
  const std::vector<Member> members = {
      {"a.nii", label_volume()}, {"b.nii", label_volume() + '\0'}, {"a.txt", std::string(kTable)}};
  EXPECT_THAT(labels_in(members, "a.nii"), SizeIs(2));
  EXPECT_THAT(labels_in(members, "b.nii"), IsEmpty());
  EXPECT_THAT(labels_in({{"seg1.nii", label_volume()},
                         {"b.nii", label_volume() + '\0'},
                         {"seg10.txt", std::string(kTable)}},
                        "b.nii"),
              SizeIs(2));
}

TEST(LabelsBeside, AreNoneWhereSeveralTablesWouldDo) {
  const std::string table(kTable);
  const Member volume = {"seg.nii", label_volume()};
  const Outcome outcome = import_bytes(zip({volume, {"x.txt", table}, {"y.txt", table}}));
  EXPECT_THAT(outcome.volume.labels, IsEmpty());
  ASSERT_THAT(codes_of(outcome), ElementsAre("looks-like-labels"));
  EXPECT_THAT(outcome.volume.notes[0].detail,
              HasSubstr("so none was used: \"x.txt\" and \"y.txt\"."));
  EXPECT_THAT(labels_in({volume, {"seg_x.txt", table}, {"seg_y.txt", table}}), IsEmpty());
  EXPECT_THAT(labels_in({volume, {"seg_x.txt", "9 x"}, {"seg.txt", table}}), SizeIs(2));
}

TEST(LabelsBeside, AreNotForImagesNorForFilesThatNameTheirOwn) {
  const Outcome image = imported(import_bytes(
      zip({{"ct.nii", nifti({}, kSmallSamples)}, {"labels.txt", std::string(kTable)}})));
  EXPECT_THAT(image.volume.labels, IsEmpty());
  EXPECT_THAT(codes_of(image), IsEmpty());
  std::string own =
      nrrd(with(with(small_nrrd(), "sizes", "6 2 4"), "type", "uint8"), label_volume().substr(352));
  own.insert(own.find("\n\n") + 1,
             "Segment0_Name:=kidney\nSegment0_LabelValue:=2\nSegment0_Layer:=0\n");
  EXPECT_THAT(labels_in({{"seg.nrrd", own}, {"seg.txt", std::string(kTable)}}),
              ElementsAre(entry(2, "kidney")));
}

TEST(LabelsBeside, AreThoseOfAClassMap) {
  EXPECT_THAT(labels_in({{"a/seg.nii", label_volume()},
                         {"a/dataset.json", R"({"labels": {"liver": 1, "spleen": 5}})"},
                         {"a/statistics.json", R"({"liver": {"volume": 6}})"}}),
              ElementsAre(entry(1, "liver"), entry(5, "spleen")));
}

TEST(LabelsBeside, ThatAreTooLongAreNone) {
  std::string longest(kTable);
  longest.append("# ").append(std::size_t{1} << 20, '-');
  EXPECT_THAT(labels_in({{"seg.nii", label_volume()}, {"seg.txt", longest}}), IsEmpty());
}

TEST(LabelsBeside, OfMricronsAtlases) {
  const std::filesystem::path folder = "/usr/share/mricron/templates";
  if (!std::filesystem::exists(folder / "aal.nii.gz")) GTEST_SKIP() << "mricron-data is missing";
  const auto labels = labels_in({{"aal.nii.gz", read_file(folder / "aal.nii.gz")},
                                 {"aal.nii.lut", read_file(folder / "aal.nii.lut")},
                                 {"aal.nii.txt", read_file(folder / "aal.nii.txt")}});
  ASSERT_THAT(labels, SizeIs(116));
  EXPECT_EQ(labels.front(), entry(1, "Precentral_L"));
}

TEST(LabelText, ReadsTheNamedColumnsOfBids) {
  EXPECT_THAT(labels_of_text("name\tindex\tabbreviation\tcolor\nGrey Matter\t1\tGM\t#ff8000\n"
                             "White Matter\t2\tWM\tn/a\n"),
              ElementsAre(LabelEntry{.label = 1, .name = "Grey Matter", .color = "#ff8000"},
                          LabelEntry{.label = 2, .name = "White Matter"}));
  EXPECT_THAT(labels_of_text("index\tname\nx\ta\n"), testing::IsEmpty());
  EXPECT_THAT(labels_of_text("index\tname\n1\n"), testing::IsEmpty());
  EXPECT_THAT(labels_of_text("index\tname\n"), testing::IsEmpty());
}

}  // namespace
}  // namespace isomesh::import::test
