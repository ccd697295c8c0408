// Arrays of Zarr and their chunks.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/import/files.h"
#include "tests/unit/import/zarr_files.h"

namespace isomesh::import::test {
namespace {

using namespace zarr;
using testing::Contains;
using testing::HasSubstr;

TEST(ZarrArray, AllCompressorsAreRead) {
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

TEST(ZarrArray, MissingChunksHaveTheFillValue) {
  std::vector<Member> members = zarr_2(array_2("null"), plain);
  members.pop_back();  // y 1, x 2
  Shorts right = right_samples();
  right[5] = right[11] = 7;
  const Outcome outcome = imported(import_bytes(zip(members)));
  EXPECT_EQ(samples_of<std::int16_t>(outcome), right);
  EXPECT_THAT(codes_of(outcome), Contains("chunks-missing"));
  EXPECT_THAT(outcome.volume.notes,
              Contains(testing::Field(&Note::detail, HasSubstr("1 of 4 chunks"))));
  members.resize(3);
  EXPECT_THAT(import_bytes(zip(members)).error, HasSubstr("hidden files"));
  members.resize(2);
  EXPECT_THAT(import_bytes(zip(members)).error, HasSubstr("array \"0\" is missing"));
}

TEST(ZarrArray, FortranOrderBigEndianAndDotsAreRead) {
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

TEST(ZarrArray, Version3IsRead) {
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

// One chunk of all samples, whose axes are y, x and z: another permutation than its inverse.
TEST(ZarrArray, TransposedAxesAreThoseOfTheChunk) {
  Shorts turned;
  for (const int y : {0, 10}) {
    for (int x = 0; x < 3; ++x) {
      for (const int z : {0, 100}) turned.push_back(static_cast<std::int16_t>(z + y + x));
    }
  }
  const std::string codecs =
      R"({"name": "transpose", "configuration": {"order": [1, 2, 0]}}, {"name": "bytes"})";
  const auto read = [](const std::string& array, const std::string& chunk) {
    return import_bytes(
        zip({{"zarr.json", kGroup3}, {"0/zarr.json", array}, {"0/c/0/0/0", chunk}}));
  };
  EXPECT_EQ(
      samples_of<std::int16_t>(imported(read(array_3(codecs, "[2, 2, 3]"), bytes_of(turned)))),
      right_samples());
  const std::string shards = R"({"name": "sharding_indexed", "configuration": {"chunk_shape":
      [2, 2, 3], "codecs": [)" +
                             codecs +
                             R"(], "index_codecs": ["bytes"], "index_location": "start"}})";
  const std::string index = bytes_of(std::vector<std::uint64_t>{16, 24});
  EXPECT_EQ(samples_of<std::int16_t>(
                imported(read(array_3(shards, "[2, 2, 3]"), index + bytes_of(turned)))),
            right_samples());
}

TEST(ZarrArray, NamesAloneAreCodecsAndEncodings) {
  std::string array = array_3(R"("bytes", "zstd")");
  const std::string encoding = R"({"name": "default", "configuration":
             {"separator": "/"}})";
  array.replace(array.find(encoding), encoding.size(), R"("default")");
  std::vector<Member> members = zarr_3("", zstd);
  members[1].bytes = array;
  EXPECT_EQ(samples_of<std::int16_t>(imported(import_bytes(zip(members)))), right_samples());
}

// The float of a chunk that is missing.
TEST(ZarrArray, FillValuesAreAlsoNamesBitsAndNull) {
  const auto filled = [](const std::string& value, const std::string& type = "float32") {
    const std::string array = R"({"zarr_format": 3, "node_type": "array", "shape": [2, 2, 4],
        "data_type": ")" + type +
                              R"(", "chunk_grid": {"name": "regular", "configuration":
        {"chunk_shape": [2, 2, 2]}}, "chunk_key_encoding": "default", "fill_value": )" +
                              value + R"(, "codecs": ["bytes"]})";
    const std::string chunk(type == "float16" ? 16 : 32, '\0');
    return import_bytes(
        zip({{"zarr.json", kGroup3}, {"0/zarr.json", array}, {"0/c/0/0/0", chunk}}));
  };
  const auto last = [&](const std::string& value, const std::string& type = "float32") {
    return samples_of<float>(imported(filled(value, type))).back();
  };
  EXPECT_EQ(last("2.5"), 2.5F);
  EXPECT_EQ(last("null"), 0);
  EXPECT_EQ(last(R"("0x40200000")"), 2.5F);
  EXPECT_EQ(last(R"("0x4100")", "float16"), 2.5F);
  for (const char* const nothing : {R"("NaN")", R"("0x7fc00000")"}) {
    EXPECT_THAT(codes_of(imported(filled(nothing))), Contains("non-finite-samples")) << nothing;
  }
  for (const char* const wrong : {R"("0x402000000")", R"("0x4020000g")", R"("none")"}) {
    EXPECT_THAT(filled(wrong).error, HasSubstr("fill_value")) << wrong;
  }
}

// Each shard has a chunk for each z; the last of them all is missing and has the fill value 0.
TEST(ZarrArray, ShardsAreRead) {
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

TEST(ZarrArray, ChunksOfOtherAxesAreRefusedBeforeTheirCodecs) {
  const auto fault = [](const std::string& array) {
    return import_bytes(zip({{"zarr.json", kGroup3}, {"0/zarr.json", array}})).error;
  };
  for (const char* const shape : {"[2, 1, 2, 1, 1, 1]", "[2, 1]"}) {
    const std::string codecs =
        sharding(R"({"name": "transpose", "configuration": {"order": [5, 4, 3, 2, 1, 0]}})", shape);
    EXPECT_THAT(fault(array_3(codecs, shape)), HasSubstr("number of axes of chunks"));
  }
  std::string array = array_2("null");
  array.replace(array.find("[2, 1, 2]"), 9, "[2, 1, 2, 1]");
  EXPECT_THAT(import_bytes(zip(zarr_2(array, plain))).error, HasSubstr("number of axes of chunks"));
}

TEST(ZarrArray, ShardsInShardsAreRefusedAtTheSecond) {
  const std::string third = sharding("\"unknown\"");
  EXPECT_THAT(import_bytes(zip(zarr_3(sharding(sharding(third)), plain))).error,
              HasSubstr("shards in shards"));
  std::string in_index = sharding("\"bytes\"");
  in_index.replace(in_index.rfind("\"bytes\""), 7, third);
  EXPECT_THAT(import_bytes(zip(zarr_3(in_index, plain))).error, HasSubstr("shards in shards"));
}

// Two chunks of 4 bytes behind each other, in front of the index.
TEST(ZarrArray, ChunksOfAShardShareNoBytes) {
  const auto fault = [](std::uint64_t size, std::uint64_t second, const std::string& codecs) {
    return import_bytes(
               zip(zarr_3(
                   sharding(codecs),
                   [&](const std::string& chunk) {
                     return chunk + bytes_of(std::vector<std::uint64_t>{0, size, second, size});
                   })))
        .error;
  };
  EXPECT_EQ(fault(4, 4, "\"bytes\""), "");
  EXPECT_THAT(fault(8, 0, "\"bytes\", \"zstd\""), HasSubstr("A shard of the Zarr is damaged"));
}

TEST(ZarrArray, BytesBehindAStreamAreDamage) {
  const auto longer = [](const std::string& chunk) { return zlib(chunk) + "more"; };
  EXPECT_THAT(import_bytes(zip(zarr_2(array_2(R"({"id": "zlib"})"), longer))).error,
              HasSubstr("damaged or truncated"));
}

// Each chunk has 240 MB, of which 12 samples are read.
TEST(ZarrArray, ChunksFarBeyondAVolumeAreRefused) {
  const std::vector<Member> members = {
      {".zattrs", multiscales(R"({"name": "t", "type": "time"},)" + kAxes, "[1, 1, 1, 1]")},
      {"0/.zarray",
       R"({"zarr_format": 2, "shape": [9, 20, 20, 20], "chunks": [240000000, 1, 1, 1],
           "dtype": "|u1", "order": "C", "fill_value": 0, "compressor": null})"},
      {"0/0.0.0.0", "a"}};
  EXPECT_THAT(import_bytes(zip(members), {}, {.volume = 0}).error,
              HasSubstr("chunks that do not reach beyond a volume"));
}

TEST(ZarrArray, WhatIsNotReadIsNamed) {
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

}  // namespace
}  // namespace isomesh::import::test
