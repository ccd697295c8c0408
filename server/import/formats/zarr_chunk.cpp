#include <algorithm>
#include <array>
#include <cstring>
#include <functional>
#include <limits>
#include <new>
#include <numeric>
#include <span>
#include <utility>

#include <blosc.h>
#include <zlib.h>
#include <zstd.h>

#include "base/files.h"
#include "server/import/formats/zarr_array.h"
#include "server/import/source/names.h"

namespace isomesh::import {
namespace {

using Bytes = std::vector<std::byte>;
using View = std::span<const std::byte>;

[[noreturn]] void throw_damaged_chunk() {
  throw_unusable("A chunk of the Zarr is damaged or truncated.");
}

[[noreturn]] void throw_damaged_shard() {
  throw_unusable("A shard of the Zarr is damaged or truncated.");
}

// Compression never adds as much.
std::uint64_t most_stored(std::uint64_t expected) {
  constexpr std::uint64_t kSlack = 1024;
  return expected + expected / 8 + kSlack;
}

// --- Codecs --------------------------------------------------------------------------------------

Bytes inflated(View stored, std::uint64_t most) {
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
  return status == Z_STREAM_END && stream.avail_in == 0 ? result : Bytes();
}

Bytes unzstd(View stored, std::uint64_t most) {
  Bytes result(most);
  const std::size_t size = ZSTD_decompress(result.data(), most, stored.data(), stored.size());
  result.resize(ZSTD_isError(size) != 0 ? 0 : size);
  return result;
}

Bytes unblosc(View stored, std::uint64_t most) {
  std::size_t size = 0;
  if (blosc_cbuffer_validate(stored.data(), stored.size(), &size) != 0 || size > most) return {};
  Bytes result(size);
  const int found = blosc_decompress_ctx(stored.data(), result.data(), size, 1);
  result.resize(found < 0 ? 0 : static_cast<std::size_t>(found));
  return result;
}

constexpr std::array<std::uint32_t, 256> castagnoli_table() {
  constexpr std::uint32_t kPolynomial = 0x82f63b78;
  std::array<std::uint32_t, 256> table = {};
  for (std::uint32_t byte = 0; byte < table.size(); ++byte) {
    std::uint32_t sum = byte;
    for (int bit = 0; bit < 8; ++bit) sum = sum >> 1 ^ ((sum & 1) != 0 ? kPolynomial : 0);
    table[byte] = sum;
  }
  return table;
}

// The bytes in front of their checksum of Castagnoli; none if it is wrong.
View checked(View stored) {
  static constexpr auto kTable = castagnoli_table();
  std::uint32_t expected = 0;
  if (stored.size() < sizeof(expected)) return {};
  const View bytes = stored.first(stored.size() - sizeof(expected));
  std::memcpy(&expected, stored.data() + bytes.size(), sizeof(expected));
  std::uint32_t sum = ~0U;
  for (const std::byte byte : bytes) {
    sum = sum >> 8 ^ kTable[(sum ^ std::to_integer<std::uint32_t>(byte)) & 0xff];
  }
  return ~sum == expected ? bytes : View();
}

Bytes decoded(ZarrCodec codec, View stored, std::uint64_t most) {
  switch (codec) {
    case ZarrCodec::kDeflate:
      return inflated(stored, most);
    case ZarrCodec::kZstd:
      return unzstd(stored, most);
    case ZarrCodec::kBlosc:
      return unblosc(stored, most);
    case ZarrCodec::kCrc32c: {
      const View bytes = checked(stored);
      return {bytes.begin(), bytes.end()};
    }
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

std::uint64_t stored_chunk_bytes(const ZarrArray& array) {
  return array.chunk_samples() * (array.is_half ? 2 : bytes_per_sample(array.type));
}

Bytes decode_bytes(const ZarrArray& array, View stored) {
  const std::size_t sample_bytes = array.is_half ? 2 : bytes_per_sample(array.type);
  const std::uint64_t expected = stored_chunk_bytes(array);
  Bytes bytes;
  for (std::size_t each = 0; each < array.decoders.size(); ++each) {
    const bool is_last = each + 1 == array.decoders.size();
    bytes = decoded(array.decoders[each], stored, is_last ? expected : most_stored(expected));
    stored = bytes;
  }
  if (stored.size() != expected) throw_damaged_chunk();
  if (array.decoders.empty()) bytes.assign(stored.begin(), stored.end());
  if (array.big_endian && sample_bytes > 1) swap_bytes(bytes, sample_bytes);
  return array.is_half ? widened(bytes) : bytes;
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

struct Range {
  std::uint64_t offset = 0;
  std::uint64_t size = 0;

  bool is_missing() const { return offset == ~std::uint64_t{0} && size == ~std::uint64_t{0}; }
};

// The ranges of a shard's chunks, which together are no longer than the shard.
std::vector<Range> ranges_of(const ZarrArray& array, View shard) {
  const std::uint64_t count = array.chunk_samples() / array.inner->chunk_samples();
  const std::uint64_t index_bytes = count * sizeof(Range) + (array.index_has_sum ? 4 : 0);
  if (shard.size() < index_bytes) throw_damaged_shard();
  View index = array.index_is_first ? shard.first(index_bytes) : shard.last(index_bytes);
  if (array.index_has_sum) index = checked(index);
  if (index.size() != count * sizeof(Range)) throw_damaged_shard();
  std::vector<Range> ranges(count);
  std::memcpy(ranges.data(), index.data(), index.size());
  const std::uint64_t most = most_stored(stored_chunk_bytes(*array.inner));
  std::uint64_t left = shard.size() - index_bytes;
  for (const Range& range : ranges) {
    if (range.is_missing()) continue;
    if (range.offset > shard.size() || range.size > shard.size() - range.offset ||
        range.size > most || range.size > left) {
      throw_damaged_shard();
    }
    left -= range.size;
  }
  return ranges;
}

// Copies the samples of a shard's chunks to their places in it.
class ShardWriter {
 public:
  ShardWriter(const ZarrArray& array, Bytes& shard)
      : inner_(*array.inner),
        size_(array.fill.size()),
        shard_(shard),
        to_(array.strides()),
        from_(inner_.strides()),
        rows_(inner_.chunk) {
    rows_.back() = 1;
  }

  // `chunk` is its place among the chunks.
  void write(const std::vector<std::uint64_t>& chunk, const Bytes& samples) {
    std::uint64_t corner = 0;
    for (std::size_t axis = 0; axis < chunk.size(); ++axis) {
      corner += chunk[axis] * inner_.chunk[axis] * to_[axis];
    }
    for_each_place(rows_, [&](const std::vector<std::uint64_t>& place) {
      write_row(shard_.data() + (corner + dot(place, to_)) * size_,
                samples.data() + dot(place, from_) * size_);
    });
  }

 private:
  void write_row(std::byte* target, const std::byte* source) const {
    const std::uint64_t count = inner_.chunk.back();
    if (from_.back() == 1) {
      std::memcpy(target, source, count * size_);
      return;
    }
    for (std::uint64_t at = 0; at < count; ++at) {
      std::memcpy(target + at * size_, source + at * from_.back() * size_, size_);
    }
  }

  const ZarrArray& inner_;
  std::size_t size_;  // of a sample
  Bytes& shard_;
  std::vector<std::uint64_t> to_;
  std::vector<std::uint64_t> from_;
  std::vector<std::uint64_t> rows_;  // of a chunk
};

Bytes decode_shard(const ZarrArray& array, View bytes) {
  const ZarrArray& inner = *array.inner;
  const std::vector<Range> ranges = ranges_of(array, bytes);
  std::vector<std::uint64_t> counts;
  for (std::size_t axis = 0; axis < inner.chunk.size(); ++axis) {
    counts.push_back(inner.shape[axis] / inner.chunk[axis]);
  }
  const std::size_t size = array.fill.size();
  Bytes result(array.chunk_samples() * size);
  for (std::size_t at = 0; at < result.size(); at += size) {
    std::memcpy(result.data() + at, array.fill.data(), size);
  }
  ShardWriter writer(array, result);
  auto range = ranges.begin();
  for_each_place(counts, [&](const std::vector<std::uint64_t>& chunk) {
    const Range& stored = *range++;
    if (stored.is_missing()) return;
    writer.write(chunk, decode_bytes(inner, bytes.subspan(stored.offset, stored.size)));
  });
  return result;
}

}  // namespace

std::vector<std::byte> decode_chunk(const ZarrArray& array, const std::filesystem::path& path) {
  constexpr std::uint64_t kBesideSamples = 80;  // of a chunk in a shard: its range and headers
  const InputFile file(path);
  const std::uint64_t chunks =
      array.inner ? array.chunk_samples() / array.inner->chunk_samples() : 0;
  if (file.size() > most_stored(stored_chunk_bytes(array)) + chunks * kBesideSamples) {
    throw_unusable("A chunk of the Zarr is longer than its samples.");
  }
  Bytes bytes(file.size());
  file.read_exactly(0, bytes);
  return array.inner ? decode_shard(array, bytes) : decode_bytes(array, bytes);
}

}  // namespace isomesh::import
