// OME-Zarr, whose files are the members of an archive.
#include <algorithm>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/import/files.h"
#include "tests/unit/import/zarr_files.h"

namespace isomesh::import::test {
namespace {

using namespace zarr;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using Vector = std::array<double, 3>;

TEST(Zarr, SamplesAndPlaceOfAnOmeZarrAreRead) {
  const Outcome outcome = import_bytes(
      zip(zarr_2(array_2("null"), plain,
                 multiscales(kAxes, "[2.5, 1.1, 0.8]",
                             R"(}, {"type": "translation", "translation": [7, 8, 9])"))));
  ASSERT_EQ(outcome.error, "");
  EXPECT_EQ(outcome.volume.format, "zarr");
  EXPECT_EQ(outcome.volume.dims, (std::array<std::uint32_t, 3>{3, 2, 2}));
  EXPECT_EQ(outcome.volume.geometry.spacing, (Vector{0.8, 1.1, 2.5}));
  EXPECT_EQ(outcome.volume.geometry.origin, (Vector{9, 8, 7}));
  EXPECT_EQ(samples_of<std::int16_t>(outcome), right_samples());
  EXPECT_THAT(codes_of(outcome), ElementsAre("space-assumed"));
  EXPECT_TRUE(outcome.volume.ignored.empty());
}

TEST(Zarr, TimesAndChannelsAreChosen) {
  std::vector<Member> members = {
      {".zattrs",
       multiscales(R"({"name": "t", "type": "time"}, {"name": "c", "type": "channel"},)" + kAxes,
                   "[1, 1, 3, 2, 1]")},
      {"0/.zarray",
       R"({"zarr_format": 2, "shape": [2, 2, 2, 2, 2], "chunks": [1, 2, 2, 2, 2], "dtype": "|u1",
           "order": "C", "fill_value": 0, "filters": null, "compressor": null})"},
      {"0/0.0.0.0.0", "abcdefghABCDEFGH"},
      {"0/1.0.0.0.0", "ijklmnopIJKLMNOP"}};
  const Outcome unchosen = import_bytes(zip(members));
  ASSERT_EQ(unchosen.remedy.choices.size(), 4);
  EXPECT_EQ(unchosen.remedy.choices[3].title, "time 1, channel 1");
  const Outcome chosen = imported(import_bytes(zip(members), {}, {.volume = 2}));
  EXPECT_EQ(chosen.sample_bytes(), "ijklmnop");
  EXPECT_THAT(codes_of(chosen), Contains("volume-chosen"));
}

TEST(Zarr, UnitsAndOrientationsPlaceIt) {
  const auto read = [](const std::string& axes) {
    return imported(import_bytes(
        zip(zarr_2(array_2("null"), plain,
                   multiscales(axes, "[4, 2, 1]",
                               R"(}, {"type": "translation", "translation": [7, 8, 9])")))));
  };
  const Outcome small =
      read(axis("z", "micrometer") + "," + axis("y", "micrometer") + "," + axis("x", "micrometer"));
  EXPECT_EQ(small.volume.geometry.spacing, (Vector{0.001, 0.002, 0.004}));
  const Outcome bare = read(R"("z", "y", "x")");
  EXPECT_THAT(codes_of(bare), Contains("unit-unknown"));
  EXPECT_EQ(bare.volume.geometry.spacing, (Vector{1, 2, 4}));
  const Outcome placeholders = read(axis("z", "?") + "," + axis("y", "???") + "," + axis("x", "?"));
  EXPECT_THAT(codes_of(placeholders), Contains("unit-unknown"));
  const auto turned = [](const std::string& name, const std::string& value) {
    return R"({"name": ")" + name + R"(", "type": "space", "unit": "millimeter", "orientation":
           {"type": "anatomical", "value": ")" +
           value + "\"}}";
  };
  const Outcome placed =
      read(turned("z", "inferior-to-superior") + "," + turned("y", "posterior-to-anterior") + "," +
           turned("x", "left-to-right"));
  EXPECT_EQ(placed.volume.geometry.origin, (Vector{-9, -8, 7}));
  EXPECT_EQ(placed.volume.geometry.direction, (std::array<double, 9>{-1, 0, 0, 0, -1, 0, 0, 0, 1}));
  EXPECT_THAT(codes_of(placed), Not(Contains("space-assumed")));
}

TEST(Zarr, OrientationsThatAreNotKnownAreNamed) {
  const auto note = [](const std::string& orientation) {
    const std::string x =
        R"({"name": "x", "type": "space", "unit": "millimeter", "orientation": {"value": ")" +
        orientation + "\"}}";
    const std::string axes = axis("z") + "," + axis("y") + "," + x;
    const Outcome outcome =
        imported(import_bytes(zip(zarr_2(array_2("null"), plain, multiscales(axes, "[1, 1, 1]")))));
    return outcome.volume.notes.at(0).detail;
  };
  EXPECT_THAT(note("rostral-to-caudal"), HasSubstr("\"rostral-to-caudal\""));
  EXPECT_THAT(note("left-to-right"), HasSubstr("only some of its axes"));
}

TEST(Zarr, SpacingsOfFilesWithoutOneAreGiven) {
  ImportOptions given;
  given.spacing = {0.5, 0.6, 0.7};
  const auto read = [&](const std::string& axes, const std::string& scale,
                        const ImportOptions& options) {
    std::string group = multiscales(axes, "[3, 2, 1]");
    if (scale.empty()) {
      group = R"({"multiscales": [{"axes": [)" + axes + R"(], "datasets": [{"path": "0"}]}]})";
    }
    return import_bytes(zip(zarr_2(array_2("null"), plain, group)), {}, options);
  };
  const auto unknown = [](const Outcome& outcome) {
    return std::ranges::count(outcome.volume.notes, "unit-unknown", &Note::code);
  };
  const std::string pixels =
      axis("z", "pixel") + "," + axis("y", "pixel") + "," + axis("x", "pixel");
  for (const auto& [axes, scale] :
       {std::pair<std::string, std::string>{R"("z", "y", "x")", "1"}, {pixels, "1"}, {kAxes, ""}}) {
    const Outcome assumed = imported(read(axes, scale, {}));
    EXPECT_EQ(unknown(assumed), 1) << axes;
    EXPECT_EQ(assumed.volume.geometry.spacing,
              scale.empty() ? (Vector{1, 1, 1}) : (Vector{1, 2, 3}));
    const Outcome placed = imported(read(axes, scale, given));
    EXPECT_EQ(unknown(placed), 0) << axes;
    EXPECT_EQ(placed.volume.geometry.spacing, (Vector{0.5, 0.6, 0.7}));
  }
  EXPECT_THAT(read(kAxes, "1", given).error, HasSubstr("its own"));
}

std::string labelled(const std::string& colors) {
  return kGroup.substr(0, kGroup.size() - 1) + R"(, "image-label": {"colors": [)" + colors + "]}}";
}

TEST(Zarr, LabelsBeyondTheLimitsAreRefused) {
  const auto fault = [](const std::string& colors) {
    return import_bytes(zip(zarr_2(array_2("null"), plain, labelled(colors)))).error;
  };
  EXPECT_THAT(fault(R"({"label-value": 9223372036854775808, "rgba": [1, 2, 3, 4]})"),
              HasSubstr("9223372036854775808"));
  EXPECT_EQ(fault(R"({"label-value": 9223372036854775807, "rgba": [1, 2, 3, 4]})"), "");
  std::string many;
  for (int label = 1; label <= 65536; ++label) {
    many +=
        (label > 1 ? "," : "") + std::string(R"({"label-value": )") + std::to_string(label) + "}";
  }
  EXPECT_THAT(fault(many), HasSubstr("65535"));
}

// Behind the first MiB, which is all that is unpacked of other headers.
TEST(Zarr, LongMetadataAreReadWhole) {
  std::string colors;
  for (int label = 1; label <= 15'000; ++label) {
    colors += (label > 1 ? "," : "") + std::string(R"({"label-value":)") + std::to_string(label) +
              R"(, "rgba": [255, 0, 128, 255], "note": "for more than 1 MiB of metadata"})";
  }
  ASSERT_GT(colors.size(), std::size_t{1} << 20);
  const Outcome outcome =
      imported(import_bytes(zip(zarr_2(array_2("null"), plain, labelled(colors)))));
  EXPECT_EQ(outcome.volume.labels.size(), 15'000);
  EXPECT_TRUE(outcome.volume.ignored.empty());
}

// The metadata of groups below are repeated at the top, which is no volume of its own.
TEST(Zarr, ConsolidatedMetadataAreNoVolume) {
  std::vector<Member> members = {
      {"zarr.json",
       R"({"attributes": {"ome": {"bioformats2raw.layout": 3}}, "zarr_format": 3, "node_type":
           "group", "consolidated_metadata": {"kind": "inline", "metadata": {"A": )" +
           kGroup3 + "}}}"},
      {".zmetadata", R"({"metadata": {".zattrs": )" + kGroup + "}}"}};
  for (const Member& member : zarr_3("\"bytes\"", plain)) {
    members.push_back({"A/" + member.name, member.bytes});
  }
  const Outcome outcome = imported(import_bytes(zip(members)));
  EXPECT_EQ(outcome.volume.name, "A");
  EXPECT_EQ(samples_of<std::int16_t>(outcome), right_samples());
}

TEST(Zarr, LabelsHaveColoursAndNames) {
  std::string group = kGroup;
  group.pop_back();
  group += R"(, "image-label": {"colors": [{"label-value": 1, "rgba": [255, 0, 128, 255]},
              {"label-value": 0, "rgba": [0, 0, 0, 0]}],
              "properties": [{"label-value": 1, "name": "liver"}, {"label-value": 2, "class": "x"}]}})";
  const Outcome outcome = imported(import_bytes(zip(zarr_2(array_2("null"), plain, group))));
  EXPECT_THAT(outcome.volume.labels,
              ElementsAre(LabelEntry{.label = 1, .name = "liver", .color = "#ff0080"},
                          LabelEntry{.label = 2, .name = "x"}));
  EXPECT_THAT(codes_of(outcome), Contains("looks-like-labels"));
}

TEST(Zarr, AnImageAndItsLabelsAreTwoVolumes) {
  std::vector<Member> members = zarr_2(array_2("null"), plain);
  members.push_back({"labels/.zattrs", R"({"labels": ["cells"]})"});
  for (const Member& member : zarr_2(array_2(R"({"id": "zlib"})"), zlib)) {
    members.push_back({"labels/cells/" + member.name, member.bytes});
  }
  const Outcome outcome = import_bytes(zip(members));
  ASSERT_EQ(outcome.remedy.choices.size(), 2) << outcome.error;
  EXPECT_EQ(outcome.remedy.choices[1].value, "labels/cells/.zattrs");
  ImportOptions options;
  options.member = "labels/cells/.zattrs";
  EXPECT_EQ(imported(import_bytes(zip(members), {}, options)).volume.name, "cells");
}

TEST(Zarr, TruncatedMetadataAreRefused) {
  const std::string array = array_2("null");
  for (std::size_t size = 0; size < array.size(); ++size) {
    const Outcome outcome = import_bytes(tar(zarr_2(array.substr(0, size), plain)));
    EXPECT_FALSE(outcome.imported()) << size;
    EXPECT_NE(outcome.code, ErrorCode::kInternal) << outcome.error;
  }
  for (std::size_t size = 0; size < kGroup.size(); ++size) {
    const Outcome outcome = import_bytes(tar(zarr_2(array, plain, kGroup.substr(0, size))));
    EXPECT_FALSE(outcome.imported()) << size;
    EXPECT_NE(outcome.code, ErrorCode::kInternal) << outcome.error;
  }
}

}  // namespace
}  // namespace isomesh::import::test
