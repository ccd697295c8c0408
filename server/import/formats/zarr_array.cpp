#include "server/import/formats/zarr_array.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <optional>
#include <span>
#include <system_error>
#include <type_traits>
#include <utility>

#include "base/files.h"
#include "base/text.h"
#include "proto/json_text.h"
#include "server/import/source/names.h"

namespace isomesh::import {
namespace {

constexpr std::uint64_t kMostAxisSamples = 1'000'000'000;
constexpr std::size_t kMostCodecs = 8;

[[noreturn]] void throw_damaged(const std::string& what) {
  throw_unusable("The Zarr's metadata is damaged: " + what + " is missing or wrong.");
}

[[noreturn]] void throw_unsupported(const std::string& what) {
  throw_unusable("The Zarr uses " + what +
                 ", which is not supported. Blosc, Zstandard, gzip and zlib are, without "
                 "filters.");
}

// A name by itself, or with a configuration.
std::string name_in(const Json& json) {
  return zarr_text(json.is_string() ? json : zarr_member(json, "name"));
}

std::vector<std::uint64_t> sizes_of(const Json& json, const std::string& what) {
  if (!json.is_array() || json.empty() || json.size() > ZarrArray::kMostAxes) throw_damaged(what);
  std::vector<std::uint64_t> sizes;
  for (const Json& size : json) {
    if (!size.is_number_unsigned() || size.get<std::uint64_t>() == 0 ||
        size.get<std::uint64_t>() > kMostAxisSamples) {
      throw_damaged(what);
    }
    sizes.push_back(size.get<std::uint64_t>());
  }
  return sizes;
}

void set_type(std::string_view name, ZarrArray& array) {
  struct Row {
    std::string_view old_name;
    std::string_view name;
    StoredType type;
  };
  static constexpr Row kTypes[] = {
      {"b1", "bool", StoredType::kUint8},      {"i1", "int8", StoredType::kInt8},
      {"u1", "uint8", StoredType::kUint8},     {"i2", "int16", StoredType::kInt16},
      {"u2", "uint16", StoredType::kUint16},   {"i4", "int32", StoredType::kInt32},
      {"u4", "uint32", StoredType::kUint32},   {"i8", "int64", StoredType::kInt64},
      {"u8", "uint64", StoredType::kUint64},   {"f2", "float16", StoredType::kFloat32},
      {"f4", "float32", StoredType::kFloat32}, {"f8", "float64", StoredType::kFloat64}};
  for (const auto& [old_name, new_name, type] : kTypes) {
    if (name != old_name && name != new_name) continue;
    array.type = type;
    array.is_half = old_name == "f2";
    return;
  }
  throw_unusable("The Zarr's samples are of type " + in_quotes(name) +
                 ", which is not supported. Integers and floats are.");
}

// The bits of a float, such as "0x7fc00000".
template <class Bits>
std::optional<Bits> bits_in(std::string_view text) {
  if (text.size() != 2 + 2 * sizeof(Bits) || !text.starts_with("0x")) return std::nullopt;
  Bits bits = 0;
  const char* end = text.data() + text.size();
  const auto [rest, fault] = std::from_chars(text.data() + 2, end, bits, 16);
  return fault == std::errc() && rest == end ? std::optional(bits) : std::nullopt;
}

float float_of_half(std::uint16_t half) {
  float value = 0;
  floats_of_halves(std::span(&half, 1), std::span(&value, 1));
  return value;
}

template <class Sample>
Sample filled(const Json& value) {
  if constexpr (std::is_floating_point_v<Sample>) {
    const std::string text = zarr_text(value);
    if (text == "NaN") return std::numeric_limits<Sample>::quiet_NaN();
    if (text == "Infinity") return std::numeric_limits<Sample>::infinity();
    if (text == "-Infinity") return -std::numeric_limits<Sample>::infinity();
    using Bits = std::conditional_t<sizeof(Sample) == 4, std::uint32_t, std::uint64_t>;
    if (const auto bits = bits_in<Bits>(text)) return std::bit_cast<Sample>(*bits);
    if (const auto half = bits_in<std::uint16_t>(text)) return float_of_half(*half);
    if (value.is_number()) return static_cast<Sample>(value.get<double>());
  }
  if (value.is_boolean()) return static_cast<Sample>(value.get<bool>() ? 1 : 0);
  if (value.is_number_unsigned()) return static_cast<Sample>(value.get<std::uint64_t>());
  if (value.is_number_integer()) return static_cast<Sample>(value.get<std::int64_t>());
  if (value.is_number()) {
    const double number = value.get<double>();
    if (number == std::floor(number) && std::abs(number) < 0x1p53) {
      return static_cast<Sample>(static_cast<std::int64_t>(number));
    }
  }
  if (value.is_null()) return Sample{0};
  throw_damaged("fill_value");
}

void set_fill(const Json& value, ZarrArray& array) {
  with_stored_sample(array.type, [&](auto sample) {
    sample = filled<decltype(sample)>(value);
    array.fill.resize(sizeof(sample));
    std::memcpy(array.fill.data(), &sample, sizeof(sample));
  });
}

void set_separator(const Json& value, ZarrArray& array) {
  const std::string text = zarr_text(value);
  if (text != "." && text != "/") throw_damaged("the separator of chunk names");
  array.separator = text[0];
}

void add_codec(const std::string& name, ZarrArray& array) {
  if (name == "gzip" || name == "zlib") {
    array.decoders.push_back(ZarrCodec::kDeflate);
  } else if (name == "zstd") {
    array.decoders.push_back(ZarrCodec::kZstd);
  } else if (name == "blosc") {
    array.decoders.push_back(ZarrCodec::kBlosc);
  } else if (name == "crc32c") {
    array.decoders.push_back(ZarrCodec::kCrc32c);
  } else {
    throw_unsupported("the codec " + in_quotes(name));
  }
}

// Codecs rely on it.
void check_chunks(const ZarrArray& array) {
  if (array.chunk.size() != array.shape.size()) throw_damaged("the number of axes of chunks");
  std::uint64_t bytes = bytes_per_sample(array.type);
  for (const std::uint64_t size : array.chunk) {
    if (size > ZarrArray::kMostChunkBytes / bytes) {
      throw_unusable("The Zarr's chunks are larger than 256 MiB, which is not supported.");
    }
    bytes *= size;
  }
}

void set_plain_order(ZarrArray& array) {
  array.order.resize(array.shape.size());
  std::iota(array.order.begin(), array.order.end(), 0);
}

void read_version_2(const Json& metadata, ZarrArray& array) {
  array.shape = sizes_of(zarr_member(metadata, "shape"), "shape");
  array.chunk = sizes_of(zarr_member(metadata, "chunks"), "chunks");
  const std::string type = zarr_text(zarr_member(metadata, "dtype"));
  if (type.size() != 3) throw_unusable("The Zarr's samples are not numbers.");
  array.big_endian = type[0] == '>';
  set_type(std::string_view(type).substr(1), array);
  check_chunks(array);
  set_plain_order(array);
  if (zarr_text(zarr_member(metadata, "order")) == "F") std::ranges::reverse(array.order);
  const Json& separator = zarr_member(metadata, "dimension_separator");
  if (!separator.is_null()) set_separator(separator, array);
  const Json& filters = zarr_member(metadata, "filters");
  if (!filters.is_null() && !filters.empty()) throw_unsupported("filters");
  const Json& compressor = zarr_member(metadata, "compressor");
  if (!compressor.is_null()) add_codec(zarr_text(zarr_member(compressor, "id")), array);
}

// Axis `order[n]` of the array is axis n of the chunk.
void transpose(const Json& order, ZarrArray& array) {
  if (!order.is_array() || order.size() != array.shape.size()) throw_damaged("transpose");
  std::vector<std::size_t> axes;
  for (const Json& axis : order) {
    if (!axis.is_number_unsigned() || axis.get<std::uint64_t>() >= order.size() ||
        std::ranges::find(axes, array.order[axis.get<std::size_t>()]) != axes.end()) {
      throw_damaged("transpose");
    }
    axes.push_back(array.order[axis.get<std::size_t>()]);
  }
  array.order = axes;
}

enum class CodecsOf { kArray, kShard };  // or of a shard's index

void read_codecs(const Json& codecs, CodecsOf owner, ZarrArray& array);

// The chunks in the shards that `array` has as chunks.
void read_shards(const Json& configuration, ZarrArray& array) {
  ZarrArray inner = array;
  inner.shape = array.chunk;
  inner.chunk = sizes_of(zarr_member(configuration, "chunk_shape"), "chunk_shape of shards");
  if (inner.chunk.size() != inner.shape.size()) throw_damaged("chunk_shape of shards");
  std::uint64_t count = 1;
  for (std::size_t axis = 0; axis < inner.chunk.size(); ++axis) {
    if (inner.shape[axis] % inner.chunk[axis] != 0) throw_damaged("chunk_shape of shards");
    const std::uint64_t along = inner.shape[axis] / inner.chunk[axis];
    if (along > ZarrArray::kMostInnerChunks / count) {
      throw_unsupported("more than a million chunks in a shard");
    }
    count *= along;
  }
  read_codecs(zarr_member(configuration, "codecs"), CodecsOf::kShard, inner);
  ZarrArray index;
  read_codecs(zarr_member(configuration, "index_codecs"), CodecsOf::kShard, index);
  array.index_has_sum = index.decoders == std::vector{ZarrCodec::kCrc32c};
  if (index.big_endian || (!index.decoders.empty() && !array.index_has_sum)) {
    throw_unsupported("an unusual index of shards");
  }
  array.index_is_first = zarr_text(zarr_member(configuration, "index_location")) == "start";
  array.inner = std::make_shared<ZarrArray>(std::move(inner));
}

void read_codecs(const Json& codecs, CodecsOf owner, ZarrArray& array) {
  if (!codecs.is_array() || codecs.size() > kMostCodecs) throw_damaged("codecs");
  for (const Json& codec : codecs) {
    const std::string name = name_in(codec);
    const Json& configuration = zarr_member(codec, "configuration");
    if (name == "transpose") {
      transpose(zarr_member(configuration, "order"), array);
    } else if (name == "bytes") {
      array.big_endian = zarr_text(zarr_member(configuration, "endian")) == "big";
    } else if (name == "sharding_indexed") {
      if (owner == CodecsOf::kShard) throw_unsupported("shards in shards");
      if (codecs.size() != 1) throw_unsupported("another codec around shards");
      read_shards(configuration, array);
    } else {
      add_codec(name, array);
    }
  }
  std::ranges::reverse(array.decoders);
}

void read_version_3(const Json& metadata, ZarrArray& array) {
  array.shape = sizes_of(zarr_member(metadata, "shape"), "shape");
  const Json& grid = zarr_member(metadata, "chunk_grid");
  if (name_in(grid) != "regular") throw_unsupported("irregular chunks");
  array.chunk =
      sizes_of(zarr_member(zarr_member(grid, "configuration"), "chunk_shape"), "chunk_shape");
  set_type(zarr_text(zarr_member(metadata, "data_type")), array);
  check_chunks(array);
  set_plain_order(array);
  const Json& encoding = zarr_member(metadata, "chunk_key_encoding");
  const std::string name = name_in(encoding);
  if (name != "default" && name != "v2") throw_damaged("chunk_key_encoding");
  array.prefix = name == "default" ? "c" : "";
  array.separator = name == "default" ? '/' : '.';
  const Json& separator = zarr_member(zarr_member(encoding, "configuration"), "separator");
  if (!separator.is_null()) set_separator(separator, array);
  if (!zarr_member(metadata, "storage_transformers").empty())
    throw_unsupported("storage transformers");
  read_codecs(zarr_member(metadata, "codecs"), CodecsOf::kArray, array);
}

}  // namespace

const Json& zarr_member(const Json& json, const char* name) {
  static const Json null;
  if (!json.is_object()) return null;
  const auto found = json.find(name);
  return found == json.end() ? null : *found;
}

std::string zarr_text(const Json& json) {
  return json.is_string() ? json.get<std::string>() : std::string();
}

Json zarr_json(const std::filesystem::path& path) {
  const InputFile file(path);
  if (file.size() > kMostZarrHeaderBytes) throw_unusable("The Zarr's metadata is too long.");
  Json json = parse_json<Json>(file.text(0, kMostZarrHeaderBytes), nullptr, false);
  if (json.is_discarded() || !json.is_object()) {
    throw_unusable("The Zarr's metadata is damaged: it is not a JSON object.");
  }
  return json;
}

std::vector<std::uint64_t> ZarrArray::strides() const {
  std::vector<std::uint64_t> strides(chunk.size());
  std::uint64_t stride = 1;
  for (std::size_t each = order.size(); each-- > 0;) {
    strides[order[each]] = stride;
    stride *= chunk[order[each]];
  }
  return strides;
}

std::uint64_t ZarrArray::chunk_samples() const {
  return std::accumulate(chunk.begin(), chunk.end(), std::uint64_t{1}, std::multiplies());
}

std::string ZarrArray::name_of(const std::vector<std::uint64_t>& place) const {
  std::string name = prefix;
  for (const std::uint64_t index : place) {
    if (!name.empty()) name += separator;
    name += std::to_string(index);
  }
  return name;
}

ZarrArray zarr_array(const Json& metadata) {
  ZarrArray array;
  const Json& version = zarr_member(metadata, "zarr_format");
  if (version == 2) {
    read_version_2(metadata, array);
  } else if (version == 3) {
    read_version_3(metadata, array);
  } else {
    throw_damaged("zarr_format");
  }
  set_fill(zarr_member(metadata, "fill_value"), array);
  return array;
}

}  // namespace isomesh::import
