#include "server/import/source/gzip.h"

#include <algorithm>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <zlib.h>

#include "proto/error.h"

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
  throw Error(ErrorCode::kUnusableVolume,
              "The compressed data is corrupt: it cannot be unpacked, or its checksum is wrong.");
}

[[noreturn]] void throw_truncated() {
  throw Error(ErrorCode::kUnusableVolume,
              "The compressed data is truncated: the file ends too early.");
}

[[noreturn]] void throw_followed() {
  throw Error(ErrorCode::kUnusableVolume,
              "The compressed data is followed by data that is not part of it.");
}

class Feed {
 public:
  Feed(const InputFile& file, const CompressedRange& range)
      : file_(file), next_(range.offset), end_(range.offset + range.bytes), piece_(kPieceBytes) {}

  // Returns false at the end of the range or of the file.
  bool refill(z_stream& stream) {
    const std::uint64_t wanted = std::min<std::uint64_t>(piece_.size(), end_ - next_);
    const std::size_t count = file_.read(next_, std::span(piece_).first(wanted));
    next_ += count;
    set_input(stream, std::span(piece_).first(count));
    return count > 0;
  }

 private:
  const InputFile& file_;
  std::uint64_t next_;
  std::uint64_t end_;
  std::vector<std::byte> piece_;
};

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
  } while (feed.refill(stream));
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
  if (stream.avail_in == 0 && !feed.refill(stream)) return false;
  return stream.next_in[0] == 0x1f;
}

}  // namespace

bool is_gzip(std::span<const std::byte> head) {
  return head.size() >= 3 && head[0] == std::byte{0x1f} && head[1] == std::byte{0x8b} &&
         head[2] == std::byte{Z_DEFLATED};
}

std::string inflate_head(std::span<const std::byte> head, std::size_t count) {
  if (!is_gzip(head)) return {};
  Inflater inflater;
  std::string result(count, '\0');
  set_input(inflater.stream(), head);
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
    if (stream.avail_in == 0 && !feed.refill(stream)) throw_truncated();
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
    throw Error(ErrorCode::kUnusableVolume, "its deflated samples are corrupt or truncated");
  }
  return target.size() - left;
}

}  // namespace isomesh::import
