// Arrays of Zarr 2 and 3 (https://zarr-specs.readthedocs.io): their metadata and chunks.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "server/import/source/stored_samples.h"

namespace isomesh::import {

using Json = nlohmann::json;

// The JSON of a file. Throws Error kUnusableVolume if it is damaged or longer than 16 MiB.
inline constexpr std::uint64_t kMostZarrHeaderBytes = std::uint64_t{16} << 20;
Json zarr_json(const std::filesystem::path& path);
// Null for a missing member.
const Json& zarr_member(const Json& json, const char* name);
// Empty if it is none.
std::string zarr_text(const Json& json);

enum class ZarrCodec { kDeflate, kZstd, kBlosc, kCrc32c };

struct ZarrArray {
  // The sizes along all axes, the slowest first; at most kMostAxes.
  static constexpr std::size_t kMostAxes = 16;
  static constexpr std::uint64_t kMostChunkBytes = std::uint64_t{256} << 20;
  static constexpr std::uint64_t kMostInnerChunks = 1'000'000;  // of a shard
  std::vector<std::uint64_t> shape;
  std::vector<std::uint64_t> chunk;
  StoredType type = StoredType::kUint8;
  bool big_endian = false;
  bool is_half = false;             // floats of 16 bits, which become `type`
  std::vector<std::size_t> order;   // the axes as a chunk stores them, the slowest first
  std::vector<ZarrCodec> decoders;  // the last that was applied is first
  std::vector<std::byte> fill;      // a sample of a missing chunk
  std::string prefix;               // of the names of chunks
  char separator = '.';
  // Not null: a chunk is a shard of such chunks, behind or in front of an index.
  std::shared_ptr<const ZarrArray> inner = {};
  bool index_is_first = false;
  bool index_has_sum = false;

  std::uint64_t chunk_samples() const;
  // From a sample of a chunk to the next along each axis, in samples.
  std::vector<std::uint64_t> strides() const;
  // The name of a chunk below the array.
  std::string name_of(const std::vector<std::uint64_t>& place) const;
};

// From `.zarray` or from an array's `zarr.json`. Throws Error kUnusableVolume that names what is
// damaged or not supported: filters, other codecs, shards in shards, chunks above 256 MiB.
ZarrArray zarr_array(const Json& metadata);

// The samples of a chunk as they are stored, or of a shard, the last axis fastest, in the byte
// order of this machine. Throws Error kUnusableVolume.
std::vector<std::byte> decode_chunk(const ZarrArray& array, const std::filesystem::path& path);

}  // namespace isomesh::import
