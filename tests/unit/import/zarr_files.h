// Members of archives that are an OME-Zarr of a few samples.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <blosc.h>
#include <zstd.h>

#include "tests/unit/import/archives.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test::zarr {

using Shorts = std::vector<std::int16_t>;
using Pack = std::function<std::string(const std::string& bytes)>;

// 3 x 2 x 2 samples in x, y and z: 100 z + 10 y + x.
inline constexpr std::uint32_t kWidth = 3;
inline Shorts right_samples() {
  Shorts samples;
  for (const int z : {0, 100}) {
    for (const int y : {0, 10}) {
      for (int x = 0; x < static_cast<int>(kWidth); ++x) samples.push_back(z + y + x);
    }
  }
  return samples;
}

inline std::string multiscales(const std::string& axes, const std::string& scale,
                               const std::string& more = {}) {
  return R"({"multiscales": [{"axes": [)" + axes +
         R"(], "datasets": [{"path": "0", "coordinateTransformations": [{"type": "scale", "scale": )" +
         scale + more + R"(}]}], "version": "0.4"}]})";
}

inline std::string axis(const std::string& name, const std::string& unit = "millimeter") {
  return R"({"name": ")" + name + R"(", "type": "space", "unit": ")" + unit + "\"}";
}

inline const std::string kAxes = axis("z") + "," + axis("y") + "," + axis("x");
inline const std::string kGroup = multiscales(kAxes, "[2.5, 1.1, 0.8]");

// Chunks of 2 x 1 x 2 samples in z, y and x, so those at the end of x are half empty.
inline std::string chunk_at(int y, int x, bool is_fortran = false, bool big_endian = false) {
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

inline std::string array_2(const std::string& compressor, const std::string& more = {}) {
  return R"({"zarr_format": 2, "shape": [2, 2, 3], "chunks": [2, 1, 2], "fill_value": 7, )"
         R"("filters": null, "compressor": )" +
         compressor +
         (more.empty() ? R"(, "dtype": "<i2", "order": "C", "dimension_separator": "/"})" : more);
}

inline std::string blosc(const std::string& bytes, const char* name, int shuffle) {
  std::string packed(bytes.size() + BLOSC_MAX_OVERHEAD, '\0');
  const int size = blosc_compress_ctx(5, shuffle, 2, bytes.size(), bytes.data(), packed.data(),
                                      packed.size(), name, 0, 1);
  packed.resize(static_cast<std::size_t>(std::max(size, 0)));
  return packed;
}

inline std::string zstd(const std::string& bytes) {
  std::string packed(ZSTD_compressBound(bytes.size()), '\0');
  packed.resize(ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), 3));
  return packed;
}

inline std::vector<Member> zarr_2(const std::string& array, const Pack& pack,
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

inline std::string plain(const std::string& bytes) { return bytes; }

// The bytes with their CRC-32C behind them; that of "123456789" is 0xe3069283.
inline std::string with_sum(std::string bytes) {
  std::uint32_t sum = ~0U;
  for (const char byte : bytes) {
    sum ^= static_cast<unsigned char>(byte);
    for (int bit = 0; bit < 8; ++bit) sum = (sum >> 1) ^ (sum % 2 == 1 ? 0x82f63b78U : 0);
  }
  return bytes + bytes_of(std::vector<std::uint32_t>{~sum});
}

inline std::string array_3(const std::string& codecs,
                           const std::string& chunk_shape = "[2, 1, 2]") {
  return R"({"zarr_format": 3, "node_type": "array", "shape": [2, 2, 3], "data_type": "int16",
             "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": )" +
         chunk_shape + R"(}}, "chunk_key_encoding": {"name": "default", "configuration":
             {"separator": "/"}}, "fill_value": 0, "codecs": [)" +
         codecs + "]}";
}

inline const std::string kGroup3 =
    R"({"zarr_format": 3, "node_type": "group", "attributes": {"ome": )" + kGroup + "}}";

inline std::vector<Member> zarr_3(const std::string& codecs, const Pack& pack,
                                  bool is_fortran = false, bool big_endian = false) {
  std::vector<Member> members = {{"zarr.json", kGroup3}, {"0/zarr.json", array_3(codecs)}};
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 2; ++x) {
      members.push_back({"0/c/0/" + std::to_string(y) + "/" + std::to_string(x),
                         pack(chunk_at(y, x, is_fortran, big_endian))});
    }
  }
  return members;
}

inline std::string sharding(const std::string& inner,
                            const std::string& chunk_shape = "[1, 1, 2]") {
  return R"({"name": "sharding_indexed", "configuration": {"chunk_shape": )" + chunk_shape +
         R"(, "codecs": [)" + inner + R"(], "index_codecs": ["bytes"]}})";
}

}  // namespace isomesh::import::test::zarr
