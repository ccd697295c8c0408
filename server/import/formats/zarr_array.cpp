#include "server/import/formats/zarr_array.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <optional>
#include <span>
#include <utility>

#include <blosc.h>
#include <zlib.h>
#include <zstd.h>

#include "base/files.h"
#include "base/text.h"
#include "proto/json_text.h"
#include "server/import/source/names.h"

namespace isomesh::import {
namespace {

constexpr std::uint64_t kMostChunkBytes = std::uint64_t{256} << 20;
constexpr std::uint64_t kMostAxisSamples = 1'000'000'000;
constexpr std::uint64_t kSlack = 1U << 16;  // of a stream around another
constexpr std::size_t kMostCodecs = 8;

using Bytes = std::vector<std::byte>;

[[noreturn]] void throw_damaged(const std::string& what) {
  throw_unusable("The Zarr's metadata is damaged: " + what + " is missing or wrong.");
}

[[noreturn]] void throw_unsupported(const std::string& what) {
  throw_unusable("The Zarr uses " + what +
                 ", which is not supported. Blosc, Zstandard, gzip and zlib are, without "
                 "filters.");
}

// Null for a missing member.
const Json& member(const Json& json, const char* name) {
  static const Json null;
  if (!json.is_object()) return null;
  const auto found = json.find(name);
  return found == json.end() ? null : *found;
}

std::string text_of(const Json& json) {
  return json.is_string() ? json.get<std::string>() : std::string();
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

template <class Sample>
Sample filled(const Json& value) {
  if constexpr (std::is_floating_point_v<Sample>) {
    const std::string text = text_of(value);
    if (text == "NaN") return std::numeric_limits<Sample>::quiet_NaN();
    if (text == "Infinity") return std::numeric_limits<Sample>::infinity();
    if (text == "-Infinity") return -std::numeric_limits<Sample>::infinity();
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
  const std::string text = text_of(value);
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

void read_version_2(const Json& metadata, ZarrArray& array) {
  array.shape = sizes_of(member(metadata, "shape"), "shape");
  array.chunk = sizes_of(member(metadata, "chunks"), "chunks");
  const std::string type = text_of(member(metadata, "dtype"));
  if (type.size() != 3) throw_unusable("The Zarr's samples are not numbers.");
  array.big_endian = type[0] == '>';
  set_type(std::string_view(type).substr(1), array);
  array.order.resize(array.shape.size());
  std::iota(array.order.begin(), array.order.end(), 0);
  if (text_of(member(metadata, "order")) == "F") std::ranges::reverse(array.order);
  const Json& separator = member(metadata, "dimension_separator");
  if (!separator.is_null()) set_separator(separator, array);
  const Json& filters = member(metadata, "filters");
  if (!filters.is_null() && !filters.empty()) throw_unsupported("filters");
  const Json& compressor = member(metadata, "compressor");
  if (!compressor.is_null()) add_codec(text_of(member(compressor, "id")), array);
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

void read_codecs(const Json& codecs, ZarrArray& array);

constexpr std::uint64_t kMostInnerChunks = 1'000'000;

// The chunks in the shards that `array` has as chunks.
void read_shards(const Json& configuration, ZarrArray& array) {
  ZarrArray inner = array;
  inner.shape = array.chunk;
  inner.chunk = sizes_of(member(configuration, "chunk_shape"), "chunk_shape of shards");
  if (inner.chunk.size() != inner.shape.size()) throw_damaged("chunk_shape of shards");
  std::uint64_t count = 1;
  for (std::size_t axis = 0; axis < inner.chunk.size(); ++axis) {
    if (inner.shape[axis] % inner.chunk[axis] != 0) throw_damaged("chunk_shape of shards");
    const std::uint64_t along = inner.shape[axis] / inner.chunk[axis];
    if (along > kMostInnerChunks / count)
      throw_unsupported("more than a million chunks in a shard");
    count *= along;
  }
  read_codecs(member(configuration, "codecs"), inner);
  if (inner.inner) throw_unsupported("shards in shards");
  ZarrArray index;
  read_codecs(member(configuration, "index_codecs"), index);
  array.index_has_sum = index.decoders == std::vector{ZarrCodec::kCrc32c};
  if (index.big_endian || (!index.decoders.empty() && !array.index_has_sum)) {
    throw_unsupported("an unusual index of shards");
  }
  array.index_is_first = text_of(member(configuration, "index_location")) == "start";
  array.inner = std::make_shared<ZarrArray>(std::move(inner));
}

void read_codecs(const Json& codecs, ZarrArray& array) {
  if (!codecs.is_array() || codecs.size() > kMostCodecs) throw_damaged("codecs");
  for (const Json& codec : codecs) {
    const std::string name = text_of(member(codec, "name"));
    const Json& configuration = member(codec, "configuration");
    if (name == "transpose") {
      transpose(member(configuration, "order"), array);
    } else if (name == "bytes") {
      array.big_endian = text_of(member(configuration, "endian")) == "big";
    } else if (name == "sharding_indexed") {
      if (codecs.size() != 1) throw_unsupported("another codec around shards");
      read_shards(configuration, array);
    } else {
      add_codec(name, array);
    }
  }
  std::ranges::reverse(array.decoders);
}

void read_version_3(const Json& metadata, ZarrArray& array) {
  array.shape = sizes_of(member(metadata, "shape"), "shape");
  const Json& grid = member(metadata, "chunk_grid");
  if (text_of(member(grid, "name")) != "regular") throw_unsupported("irregular chunks");
  array.chunk = sizes_of(member(member(grid, "configuration"), "chunk_shape"), "chunk_shape");
  set_type(text_of(member(metadata, "data_type")), array);
  array.order.resize(array.shape.size());
  std::iota(array.order.begin(), array.order.end(), 0);
  const Json& encoding = member(metadata, "chunk_key_encoding");
  const std::string name = text_of(member(encoding, "name"));
  if (name != "default" && name != "v2") throw_damaged("chunk_key_encoding");
  array.prefix = name == "default" ? "c" : "";
  array.separator = name == "default" ? '/' : '.';
  const Json& separator = member(member(encoding, "configuration"), "separator");
  if (!separator.is_null()) set_separator(separator, array);
  if (!member(metadata, "storage_transformers").empty()) throw_unsupported("storage transformers");
  read_codecs(member(metadata, "codecs"), array);
}

// --- Codecs --------------------------------------------------------------------------------------

Bytes inflated(const Bytes& stored, std::uint64_t most) {
  constexpr int kZlibOrGzip = 15 + 32;
  z_stream stream = {};
  if (inflateInit2(&stream, kZlibOrGzip) != Z_OK) throw std::bad_alloc();
  Bytes result(most);
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(stored.data()));
  stream.avail_in = static_cast<uInt>(stored.size());
  stream.next_out = reinterpret_cast<Bytef*>(result.data());
  stream.avail_out = static_cast<uInt>(most);
  const int status = ::inflate(&stream, Z_FINISH);
  result.resize(most - stream.avail_out);
  inflateEnd(&stream);
  return status == Z_STREAM_END ? result : Bytes();
}

Bytes unzstd(const Bytes& stored, std::uint64_t most) {
  Bytes result(most);
  const std::size_t size = ZSTD_decompress(result.data(), most, stored.data(), stored.size());
  result.resize(ZSTD_isError(size) != 0 ? 0 : size);
  return result;
}

Bytes unblosc(const Bytes& stored, std::uint64_t most) {
  std::size_t size = 0;
  if (blosc_cbuffer_validate(stored.data(), stored.size(), &size) != 0 || size > most) return {};
  Bytes result(size);
  const int found = blosc_decompress_ctx(stored.data(), result.data(), size, 1);
  result.resize(found < 0 ? 0 : static_cast<std::size_t>(found));
  return result;
}

// The checksum of Castagnoli behind the bytes.
Bytes checked(Bytes stored) {
  constexpr std::uint32_t kPolynomial = 0x82f63b78;
  std::uint32_t expected = 0;
  if (stored.size() < sizeof(expected)) return {};
  const std::size_t size = stored.size() - sizeof(expected);
  std::memcpy(&expected, stored.data() + size, sizeof(expected));
  stored.resize(size);
  std::uint32_t sum = ~0U;
  for (const std::byte byte : stored) {
    sum ^= std::to_integer<std::uint32_t>(byte);
    for (int bit = 0; bit < 8; ++bit) sum = sum >> 1 ^ ((sum & 1) != 0 ? kPolynomial : 0);
  }
  return ~sum == expected ? stored : Bytes();
}

Bytes decoded(ZarrCodec codec, Bytes stored, std::uint64_t most) {
  switch (codec) {
    case ZarrCodec::kDeflate:
      return inflated(stored, most);
    case ZarrCodec::kZstd:
      return unzstd(stored, most);
    case ZarrCodec::kBlosc:
      return unblosc(stored, most);
    case ZarrCodec::kCrc32c:
      return checked(std::move(stored));
  }
  return {};
}

Bytes widened(const Bytes& samples) {
  std::vector<std::uint16_t> halves(samples.size() / sizeof(std::uint16_t));
  std::memcpy(halves.data(), samples.data(), samples.size());
  std::vector<float> floats(halves.size());
  floats_of_halves(halves, floats);
  const auto bytes = std::as_bytes(std::span(floats));
  return {bytes.begin(), bytes.end()};
}

}  // namespace

Json zarr_json(const std::filesystem::path& path) {
  const InputFile file(path);
  if (file.size() > kMostZarrHeaderBytes) throw_unusable("The Zarr's metadata is too long.");
  Json json = parse_json<Json>(file.text(0, kMostZarrHeaderBytes), nullptr, false);
  if (json.is_discarded() || !json.is_object()) {
    throw_unusable("The Zarr's metadata is damaged: it is not a JSON object.");
  }
  return json;
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
  const Json& version = member(metadata, "zarr_format");
  if (version == 2) {
    read_version_2(metadata, array);
  } else if (version == 3) {
    read_version_3(metadata, array);
  } else {
    throw_damaged("zarr_format");
  }
  if (array.chunk.size() != array.shape.size()) throw_damaged("the number of axes of chunks");
  std::uint64_t bytes = bytes_per_sample(array.type);
  for (const std::uint64_t size : array.chunk) {
    if (size > kMostChunkBytes / bytes) {
      throw_unusable("The Zarr's chunks are larger than 256 MiB, which is not supported.");
    }
    bytes *= size;
  }
  set_fill(member(metadata, "fill_value"), array);
  return array;
}

namespace {

Bytes decode_bytes(const ZarrArray& array, Bytes bytes) {
  const std::size_t sample_bytes = array.is_half ? 2 : bytes_per_sample(array.type);
  const std::uint64_t expected = array.chunk_samples() * sample_bytes;
  for (const ZarrCodec codec : array.decoders) {
    bytes = decoded(codec, std::move(bytes), expected + kSlack);
  }
  if (bytes.size() != expected) throw_unusable("A chunk of the Zarr is damaged or truncated.");
  if (array.big_endian && sample_bytes > 1) swap_bytes(bytes, sample_bytes);
  return array.is_half ? widened(bytes) : bytes;
}

std::vector<std::uint64_t> strides_of(const std::vector<std::uint64_t>& sizes,
                                      const std::vector<std::size_t>& order) {
  std::vector<std::uint64_t> strides(sizes.size());
  std::uint64_t stride = 1;
  for (std::size_t each = order.size(); each-- > 0;) {
    strides[order[each]] = stride;
    stride *= sizes[order[each]];
  }
  return strides;
}

// Calls `use` with each place in a box of these sizes, the last axis fastest.
template <class Use>
void for_each_place(const std::vector<std::uint64_t>& sizes, Use use) {
  std::vector<std::uint64_t> place(sizes.size());
  for (;;) {
    use(place);
    std::size_t axis = sizes.size();
    while (axis > 0 && ++place[axis - 1] == sizes[axis - 1]) place[--axis] = 0;
    if (axis == 0) return;
  }
}

std::uint64_t dot(const std::vector<std::uint64_t>& one, const std::vector<std::uint64_t>& other) {
  return std::inner_product(one.begin(), one.end(), other.begin(), std::uint64_t{0});
}

Bytes decode_shard(const ZarrArray& array, const Bytes& bytes) {
  constexpr std::uint64_t kMissing = ~std::uint64_t{0};
  const ZarrArray& inner = *array.inner;
  std::vector<std::uint64_t> counts;
  for (std::size_t axis = 0; axis < inner.chunk.size(); ++axis) {
    counts.push_back(inner.shape[axis] / inner.chunk[axis]);
  }
  const std::uint64_t count = array.chunk_samples() / inner.chunk_samples();
  const std::uint64_t index_bytes = count * 16 + (array.index_has_sum ? 4 : 0);
  if (bytes.size() < index_bytes) throw_unusable("A shard of the Zarr is damaged or truncated.");
  const auto first =
      array.index_is_first ? bytes.begin() : bytes.end() - static_cast<std::ptrdiff_t>(index_bytes);
  Bytes index(first, first + static_cast<std::ptrdiff_t>(index_bytes));
  if (array.index_has_sum) index = checked(std::move(index));
  if (index.size() != count * 16) throw_unusable("A shard of the Zarr is damaged or truncated.");

  std::vector<std::size_t> plain(inner.shape.size());
  std::iota(plain.begin(), plain.end(), 0);
  const std::vector<std::uint64_t> to = strides_of(inner.shape, plain);
  const std::vector<std::uint64_t> from = strides_of(inner.chunk, inner.order);
  const std::size_t size = array.fill.size();
  Bytes result(array.chunk_samples() * size);
  for (std::size_t at = 0; at < result.size(); at += size) {
    std::memcpy(result.data() + at, array.fill.data(), size);
  }
  const std::byte* entry = index.data();
  for_each_place(counts, [&](const std::vector<std::uint64_t>& chunk) {
    std::uint64_t range[2] = {};
    std::memcpy(range, entry, sizeof(range));
    entry += sizeof(range);
    if (range[0] == kMissing && range[1] == kMissing) return;
    if (range[0] > bytes.size() || range[1] > bytes.size() - range[0]) {
      throw_unusable("A shard of the Zarr is damaged or truncated.");
    }
    const auto begin = bytes.begin() + static_cast<std::ptrdiff_t>(range[0]);
    const Bytes samples =
        decode_bytes(inner, {begin, begin + static_cast<std::ptrdiff_t>(range[1])});
    std::uint64_t corner = 0;
    for (std::size_t axis = 0; axis < chunk.size(); ++axis) {
      corner += chunk[axis] * inner.chunk[axis] * to[axis];
    }
    for_each_place(inner.chunk, [&](const std::vector<std::uint64_t>& place) {
      std::memcpy(result.data() + (corner + dot(place, to)) * size,
                  samples.data() + dot(place, from) * size, size);
    });
  });
  return result;
}

}  // namespace

std::vector<std::byte> decode_chunk(const ZarrArray& array, const std::filesystem::path& path) {
  const std::size_t sample_bytes = array.is_half ? 2 : bytes_per_sample(array.type);
  const std::uint64_t expected = array.chunk_samples() * sample_bytes;
  constexpr std::uint64_t kIndexBytes = kMostInnerChunks * 16;
  const InputFile file(path);
  // Compression never adds as much.
  if (file.size() > expected + expected / 8 + kSlack + (array.inner ? kIndexBytes : 0)) {
    throw_unusable("A chunk of the Zarr is longer than its samples.");
  }
  Bytes bytes(file.size());
  file.read_exactly(0, bytes);
  return array.inner ? decode_shard(array, bytes) : decode_bytes(array, std::move(bytes));
}

}  // namespace isomesh::import
