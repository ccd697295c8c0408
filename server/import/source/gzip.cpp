#include "server/import/source/gzip.h"

#include <algorithm>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <bzlib.h>
#include <zlib.h>

#include "proto/error.h"
#include "server/volume/unusable.h"

namespace isomesh::import {
namespace {

int window_bits(Wrapping wrapping) {
  return wrapping == Wrapping::kNone ? -MAX_WBITS : MAX_WBITS + 32;
}

class Inflater {
 public:
  explicit Inflater(Wrapping wrapping = Wrapping::kZlibOrGzip) {
    if (inflateInit2(&stream_, window_bits(wrapping)) != Z_OK) {
      throw Error(ErrorCode::kInternal, "zlib cannot start.");
    }
  }
  ~Inflater() { inflateEnd(&stream_); }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;

  z_stream& stream() { return stream_; }

 private:
  z_stream stream_ = {};
};

// zlib's interface lacks const, but zlib only reads its input.
void set_input(z_stream& stream, std::span<const std::byte> input) {
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(input.data()));
  stream.avail_in = static_cast<uInt>(input.size());
}

void set_output(z_stream& stream, std::span<std::byte> output) {
  stream.next_out = reinterpret_cast<Bytef*>(output.data());
  stream.avail_out = static_cast<uInt>(output.size());
}

[[noreturn]] void throw_corrupt() {
  volume::throw_unusable(
      "The compressed data is corrupt: it cannot be unpacked, or its checksum is wrong.");
}

[[noreturn]] void throw_truncated() {
  volume::throw_unusable("The compressed data is truncated: the file ends too early.");
}

[[noreturn]] void throw_followed() {
  volume::throw_unusable("The compressed data is followed by data that is not part of it.");
}

// The compressed bytes of a range, piece by piece.
class Feed {
 public:
  Feed(const InputFile& file, const CompressedRange& range)
      : file_(file), next_(range.offset), end_(range.offset + range.bytes), piece_(kPieceBytes) {}

  // Empty at the end of the range or of the file.
  std::span<std::byte> next() {
    const std::uint64_t wanted = std::min<std::uint64_t>(piece_.size(), end_ - next_);
    const std::size_t count = file_.read(next_, std::span(piece_).first(wanted));
    next_ += count;
    return std::span(piece_).first(count);
  }

 private:
  const InputFile& file_;
  std::uint64_t next_;
  std::uint64_t end_;
  std::vector<std::byte> piece_;
};

// Returns false at the end.
bool refill(Feed& feed, z_stream& stream) {
  const std::span<std::byte> piece = feed.next();
  set_input(stream, piece);
  return !piece.empty();
}

struct Trailer {
  std::uint32_t checksum = 0;
  std::uint32_t bytes = 0;  // modulo 2^32

  void add(std::span<const std::byte> inflated) {
    const auto count = static_cast<uInt>(inflated.size());
    checksum = static_cast<std::uint32_t>(
        crc32(checksum, reinterpret_cast<const Bytef*>(inflated.data()), count));
    bytes += count;
  }

  std::string text() const {
    std::string result;
    for (const std::uint32_t word : {checksum, bytes}) {
      for (unsigned shift = 0; shift < 32; shift += 8) {
        result += static_cast<char>(word >> shift & 0xFFU);
      }
    }
    return result;
  }
};

// Some writers pad the last block with zeros, and some writers of raw deflate data append gzip's
// trailer. Nothing else may follow.
void require_only_padding(Feed& feed, z_stream& stream, const std::optional<Trailer>& trailer) {
  std::string rest;
  do {
    for (const Bytef byte : std::span(stream.next_in, stream.avail_in)) {
      if (rest.size() < sizeof(Trailer) && (byte != 0 || !rest.empty())) {
        rest += static_cast<char>(byte);
      } else if (byte != 0) {
        throw_followed();
      }
    }
  } while (refill(feed, stream));
  if (rest.empty()) return;
  // A checksum may begin with zeros, which were consumed as padding, and end with zeros.
  std::string expected = trailer ? trailer->text() : std::string();
  expected.erase(0, std::min(expected.find_first_not_of('\0'), expected.size()));
  if (expected.empty() || !rest.starts_with(expected) ||
      rest.find_first_not_of('\0', expected.size()) != rest.npos) {
    throw_followed();
  }
}

bool another_member_follows(Feed& feed, z_stream& stream) {
  if (stream.avail_in == 0 && !refill(feed, stream)) return false;
  return stream.next_in[0] == 0x1f;
}

class Bzip2Stream {
 public:
  Bzip2Stream() {
    if (BZ2_bzDecompressInit(&stream_, 0, 0) != BZ_OK) {
      throw Error(ErrorCode::kInternal, "bzip2 cannot start.");
    }
  }
  ~Bzip2Stream() { BZ2_bzDecompressEnd(&stream_); }
  Bzip2Stream(const Bzip2Stream&) = delete;
  Bzip2Stream& operator=(const Bzip2Stream&) = delete;

  // Decodes from `input` to `output`. Returns the number of bytes written; leaves the rest in
  // `input`, and sets `is_over` at the end of the stream.
  std::size_t decode(std::span<std::byte>& input, std::span<std::byte> output, bool& is_over) {
    stream_.next_in = reinterpret_cast<char*>(input.data());
    stream_.avail_in = static_cast<unsigned>(input.size());
    stream_.next_out = reinterpret_cast<char*>(output.data());
    stream_.avail_out = static_cast<unsigned>(output.size());
    const int status = BZ2_bzDecompress(&stream_);
    if (status != BZ_OK && status != BZ_STREAM_END) throw_corrupt();
    is_over = status == BZ_STREAM_END;
    input = input.last(stream_.avail_in);
    return output.size() - stream_.avail_out;
  }

 private:
  bz_stream stream_ = {};
};

// Some writers pad the last block with zeros. Nothing else may follow.
bool is_padding(std::span<const std::byte> bytes) {
  return std::ranges::all_of(bytes, [](std::byte byte) { return byte == std::byte{0}; });
}

}  // namespace

bool is_gzip(std::string_view head) { return head.starts_with("\x1f\x8b\x08"); }

std::string inflate_head(std::string_view head, std::size_t count) {
  if (!is_gzip(head)) return {};
  Inflater inflater;
  std::string result(count, '\0');
  set_input(inflater.stream(), std::as_bytes(std::span(head)));
  set_output(inflater.stream(), std::as_writable_bytes(std::span(result)));
  inflate(&inflater.stream(), Z_SYNC_FLUSH);
  result.resize(count - inflater.stream().avail_out);
  return result;
}

std::uint64_t inflate_range(const InputFile& file, const CompressedRange& range,
                            std::uint64_t limit, const ByteSink& sink, Wrapping wrapping) {
  Inflater inflater(wrapping);
  z_stream& stream = inflater.stream();
  Feed feed(file, range);
  std::vector<std::byte> output(kPieceBytes);
  std::uint64_t produced = 0;
  Trailer trailer;
  for (;;) {
    // Input is refilled only if the output was not full: otherwise zlib may hold back inflated
    // bytes.
    if (stream.avail_in == 0 && !refill(feed, stream)) throw_truncated();
    int status = Z_OK;
    do {
      set_output(stream, output);
      status = inflate(&stream, Z_NO_FLUSH);
      if (status != Z_OK && status != Z_STREAM_END && status != Z_BUF_ERROR) throw_corrupt();
      const std::size_t count = output.size() - stream.avail_out;
      if (count > limit - produced) return limit + 1;
      produced += count;
      if (wrapping == Wrapping::kNone) trailer.add(std::span(output).first(count));
      if (count > 0) sink(std::span(output).first(count));
    } while (status != Z_STREAM_END && stream.avail_out == 0);
    if (status != Z_STREAM_END) continue;
    if (wrapping == Wrapping::kNone || !another_member_follows(feed, stream)) break;
    inflateReset(&stream);
  }
  require_only_padding(feed, stream,
                       wrapping == Wrapping::kNone ? std::optional(trailer) : std::nullopt);
  return produced;
}

std::size_t inflate_bytes(std::span<const std::byte> stream, std::span<std::byte> target) {
  Inflater inflater(Wrapping::kNone);
  set_input(inflater.stream(), stream);
  set_output(inflater.stream(), target);
  const int result = inflate(&inflater.stream(), Z_FINISH);
  const std::size_t left = inflater.stream().avail_out;
  if (result != Z_STREAM_END && left > 0) {
    volume::throw_unusable("its deflated samples are corrupt or truncated");
  }
  return target.size() - left;
}

std::uint64_t unzip2_range(const InputFile& file, const CompressedRange& range, std::uint64_t limit,
                           const ByteSink& sink) {
  Feed feed(file, range);
  std::vector<std::byte> output(kPieceBytes);
  std::span<std::byte> input;
  const auto refill = [&] {
    if (input.empty()) input = feed.next();
    return !input.empty();
  };
  std::uint64_t produced = 0;
  do {
    Bzip2Stream stream;
    // After a full output the library may hold back decoded bytes.
    bool is_full = false;
    for (bool is_over = false; !is_over;) {
      if (!is_full && !refill()) throw_truncated();
      const std::size_t count = stream.decode(input, output, is_over);
      is_full = count == output.size();
      if (count > limit - produced) return limit + 1;
      produced += count;
      if (count > 0) sink(std::span(output).first(count));
    }
  } while (refill() && input.front() == std::byte{'B'});
  do {
    if (!is_padding(input)) throw_followed();
    input = {};
  } while (refill());
  return produced;
}

}  // namespace isomesh::import
