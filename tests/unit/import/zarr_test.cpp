// OME-Zarr, whose files are the members of an archive.
#include <functional>

#include <blosc.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zstd.h>

#include "tests/unit/import/archives.h"
#include "tests/unit/import/files.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using Vector = std::array<double, 3>;
using Shorts = std::vector<std::int16_t>;
using Pack = std::function<std::string(const std::string& bytes)>;

// 3 x 2 x 2 samples in x, y and z: 100 z + 10 y + x.
constexpr std::uint32_t kWidth = 3;
Shorts right_samples() {
  Shorts samples;
  for (const int z : {0, 100}) {
    for (const int y : {0, 10}) {
      for (int x = 0; x < static_cast<int>(kWidth); ++x) samples.push_back(z + y + x);
    }
  }
  return samples;
}

std::string multiscales(const std::string& axes, const std::string& scale,
                        const std::string& more = {}) {
  return R"({"multiscales": [{"axes": [)" + axes +
         R"(], "datasets": [{"path": "0", "coordinateTransformations": [{"type": "scale", "scale": )" +
         scale + more + R"(}]}], "version": "0.4"}]})";
}

std::string axis(const std::string& name, const std::string& unit = "millimeter") {
  return R"({"name": ")" + name + R"(", "type": "space", "unit": ")" + unit + "\"}";
}

const std::string kAxes = axis("z") + "," + axis("y") + "," + axis("x");
const std::string kGroup = multiscales(kAxes, "[2.5, 1.1, 0.8]");

// Chunks of 2 x 1 x 2 samples in z, y and x, so those at the end of x are half empty.
std::string chunk_at(int y, int x, bool is_fortran = false, bool big_endian = false) {
  Shorts samples;
  const auto value = [&](int z, int dx) {
    return static_cast<std::int16_t>(2 * x + dx < 3 ? 100 * z + 10 * y + 2 * x + dx : -1);
  };
  for (int one = 0; one < 2; ++one) {
    for (int other = 0; other < 2; ++other) {
      samples.push_back(is_fortran ? value(other, one) : value(one, other));
    }
  }
  return bytes_of(samples, big_endian);
}

std::string array_2(const std::string& compressor, const std::string& more = {}) {
  return R"({"zarr_format": 2, "shape": [2, 2, 3], "chunks": [2, 1, 2], "fill_value": 7, )"
         R"("filters": null, "compressor": )" +
         compressor +
         (more.empty() ? R"(, "dtype": "<i2", "order": "C", "dimension_separator": "/"})" : more);
}

std::string blosc(const std::string& bytes, const char* name, int shuffle) {
  std::string packed(bytes.size() + BLOSC_MAX_OVERHEAD, '\0');
  const int size = blosc_compress_ctx(5, shuffle, 2, bytes.size(), bytes.data(), packed.data(),
                                      packed.size(), name, 0, 1);
  packed.resize(static_cast<std::size_t>(std::max(size, 0)));
  return packed;
}

std::string zstd(const std::string& bytes) {
  std::string packed(ZSTD_compressBound(bytes.size()), '\0');
  packed.resize(ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), 3));
  return packed;
}

std::vector<Member> zarr_2(const std::string& array, const Pack& pack,
                           const std::string& group = kGroup) {
  std::vector<Member> members = {
      {".zgroup", R"({"zarr_format": 2})"}, {".zattrs", group}, {"0/.zarray", array}};
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 2; ++x) {
      members.push_back(
          {"0/0/" + std::to_string(y) + "/" + std::to_string(x), pack(chunk_at(y, x))});
    }
  }
  return members;
}

std::string plain(const std::string& bytes) { return bytes; }

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

TEST(Zarr, AllCompressorsAreRead) {
  const auto samples = [](const std::string& compressor, const Pack& pack) {
    const Outcome outcome = import_bytes(zip(zarr_2(array_2(compressor), pack)));
    return outcome.error.empty() ? samples_of<std::int16_t>(outcome) : Shorts();
  };
  EXPECT_EQ(samples(R"({"id": "zlib"})", zlib), right_samples());
  EXPECT_EQ(samples(R"({"id": "gzip"})", gzip), right_samples());
  EXPECT_EQ(samples(R"({"id": "zstd"})", zstd), right_samples());
  for (const char* name : {"lz4", "lz4hc", "zlib", "zstd", "blosclz"}) {
    for (const int shuffle : {BLOSC_NOSHUFFLE, BLOSC_SHUFFLE, BLOSC_BITSHUFFLE}) {
      const auto pack = [&](const std::string& bytes) { return blosc(bytes, name, shuffle); };
      EXPECT_EQ(samples(R"({"id": "blosc"})", pack), right_samples()) << name << shuffle;
    }
  }
}

TEST(Zarr, MissingChunksHaveTheFillValue) {
  std::vector<Member> members = zarr_2(array_2("null"), plain);
  members.pop_back();  // y 1, x 2
  Shorts right = right_samples();
  right[5] = right[11] = 7;
  EXPECT_EQ(samples_of<std::int16_t>(imported(import_bytes(zip(members)))), right);
  members.resize(3);
  EXPECT_THAT(import_bytes(zip(members)).error, HasSubstr("hidden files"));
  members.resize(2);
  EXPECT_THAT(import_bytes(zip(members)).error, HasSubstr("array \"0\" is missing"));
}

TEST(Zarr, FortranOrderBigEndianAndDotsAreRead) {
  std::vector<Member> members = {
      {"a.zarr/.zattrs", kGroup},
      {"a.zarr/0/.zarray", array_2("null", R"(, "dtype": ">i2", "order": "F"})")}};
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 2; ++x) {
      members.push_back({"a.zarr/0/0." + std::to_string(y) + "." + std::to_string(x),
                         chunk_at(y, x, true, true)});
    }
  }
  const Outcome outcome = imported(import_bytes(tar(members)));
  EXPECT_EQ(samples_of<std::int16_t>(outcome), right_samples());
  EXPECT_EQ(outcome.volume.name, "a.zarr");
}

// The bytes with their CRC-32C behind them; that of "123456789" is 0xe3069283.
std::string with_sum(std::string bytes) {
  std::uint32_t sum = ~0U;
  for (const char byte : bytes) {
    sum ^= static_cast<unsigned char>(byte);
    for (int bit = 0; bit < 8; ++bit) sum = (sum >> 1) ^ (sum % 2 == 1 ? 0x82f63b78U : 0);
  }
  return bytes + bytes_of(std::vector<std::uint32_t>{~sum});
}

std::vector<Member> zarr_3(const std::string& codecs, const Pack& pack, bool is_fortran = false,
                           bool big_endian = false) {
  const std::string group =
      R"({"zarr_format": 3, "node_type": "group", "attributes": {"ome": )" + kGroup + "}}";
  std::vector<Member> members = {
      {"zarr.json", group},
      {"0/zarr.json",
       R"({"zarr_format": 3, "node_type": "array", "shape": [2, 2, 3], "data_type": "int16",
           "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": [2, 1, 2]}},
           "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
           "fill_value": 0, "codecs": [)" +
           codecs + "]}"}};
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 2; ++x) {
      members.push_back({"0/c/0/" + std::to_string(y) + "/" + std::to_string(x),
                         pack(chunk_at(y, x, is_fortran, big_endian))});
    }
  }
  return members;
}

TEST(Zarr, Version3IsRead) {
  const std::string bytes = R"({"name": "bytes", "configuration": {"endian": "little"}})";
  EXPECT_EQ(samples_of<std::int16_t>(imported(import_bytes(zip(zarr_3(bytes, plain))))),
            right_samples());
  const std::string turned =
      R"({"name": "transpose", "configuration": {"order": [2, 1, 0]}}, {"name": "bytes",
          "configuration": {"endian": "big"}}, {"name": "zstd"}, {"name": "crc32c"})";
  const auto pack = [](const std::string& chunk) { return with_sum(zstd(chunk)); };
  EXPECT_EQ(samples_of<std::int16_t>(imported(import_bytes(zip(zarr_3(turned, pack, true, true))))),
            right_samples());
  const auto damaged = [&](const std::string& chunk) {
    std::string packed = pack(chunk);
    packed.back() ^= 1;
    return packed;
  };
  EXPECT_THAT(import_bytes(zip(zarr_3(turned, damaged, true, true))).error, HasSubstr("damaged"));
}

// Each shard has a chunk for each z; the last of them all is missing and has the fill value 0.
TEST(Zarr, ShardsAreRead) {
  const std::string sharding =
      R"({"name": "sharding_indexed", "configuration": {"chunk_shape": [1, 1, 2], "codecs":
          [{"name": "bytes", "configuration": {"endian": "little"}}, {"name": "zstd"}],
          "index_codecs": [{"name": "bytes", "configuration": {"endian": "little"}},
          {"name": "crc32c"}], "index_location": "end"}})";
  const auto pack = [](const std::string& chunk) {
    const std::string first = zstd(chunk.substr(0, 4));
    const std::string second = zstd(chunk.substr(4));
    const bool is_last = chunk == chunk_at(1, 1);
    const std::uint64_t none = ~std::uint64_t{0};
    const std::string index = bytes_of(std::vector<std::uint64_t>{
        0, first.size(), is_last ? none : first.size(), is_last ? none : second.size()});
    return first + second + with_sum(index);
  };
  Shorts right = right_samples();
  right[11] = 0;
  EXPECT_EQ(samples_of<std::int16_t>(imported(import_bytes(zip(zarr_3(sharding, pack))))), right);
  for (const std::size_t at : {0, 30, 50}) {
    const auto damaged = [&](const std::string& chunk) {
      std::string packed = pack(chunk);
      packed[at] = static_cast<char>(packed[at] ^ 0x41);
      return packed;
    };
    EXPECT_THAT(import_bytes(zip(zarr_3(sharding, damaged))).error, HasSubstr("damaged")) << at;
  }
  const auto cut = [](const std::string& chunk) { return chunk.substr(0, 5); };
  EXPECT_THAT(import_bytes(zip(zarr_3(sharding, cut))).error, HasSubstr("shard"));
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

TEST(Zarr, WhatIsNotReadIsNamed) {
  const auto fault = [](const std::string& array, const Pack& pack = plain) {
    return import_bytes(zip(zarr_2(array, pack))).error;
  };
  EXPECT_THAT(fault(array_2(R"({"id": "jpeg2k"})")), HasSubstr("codec \"jpeg2k\""));
  EXPECT_THAT(fault(array_2("null", R"(, "dtype": "<c8", "order": "C"})")), HasSubstr("\"c8\""));
  std::string array = array_2("null");
  array.replace(array.find("\"filters\": null"), 15, R"("filters": [{"id": "delta"}])");
  EXPECT_THAT(fault(array), HasSubstr("filters"));
  const auto cut = [](const std::string& bytes) { return bytes.substr(1); };
  EXPECT_THAT(fault(array_2("null"), cut), HasSubstr("damaged or truncated"));
  EXPECT_THAT(fault(array_2(R"({"id": "blosc"})")), HasSubstr("damaged or truncated"));
  const auto replaced = [&](const std::string& from, const std::string& to) {
    std::string changed = array_2("null");
    changed.replace(changed.find(from), from.size(), to);
    return import_bytes(zip(zarr_2(changed, plain))).code;
  };
  EXPECT_EQ(replaced("[2, 2, 3]", "[100000, 100000, 100000]"), ErrorCode::kTooLarge);
  EXPECT_EQ(replaced("[2, 1, 2]", "[1000000, 1000000, 1000000]"), ErrorCode::kUnusableVolume);
  EXPECT_EQ(replaced("[2, 1, 2]", "[2, 0, 2]"), ErrorCode::kUnusableVolume);
  EXPECT_THAT(import_bytes(zip({{".zarray", array_2("null")}})).error, HasSubstr("multiscales"));
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
