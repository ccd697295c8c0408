#include "server/import/source/bzip2.h"

#include <algorithm>
#include <vector>

#include <bzlib.h>

#include "proto/error.h"
#include "server/volume/unusable.h"

namespace isomesh::import {
namespace {

constexpr std::size_t kBufferBytes = std::size_t{1} << 18;

class Stream {
 public:
  Stream() {
    if (BZ2_bzDecompressInit(&stream_, 0, 0) != BZ_OK) {
      throw Error(ErrorCode::kInternal, "bzip2 cannot start.");
    }
  }
  ~Stream() { BZ2_bzDecompressEnd(&stream_); }
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;

  // Decodes from `input` to `output`. Returns the number of bytes written; leaves the rest in
  // `input`, and sets `is_over` at the end of the stream.
  std::size_t decode(std::span<std::byte>& input, std::span<std::byte> output, bool& is_over) {
    stream_.next_in = reinterpret_cast<char*>(input.data());
    stream_.avail_in = static_cast<unsigned>(input.size());
    stream_.next_out = reinterpret_cast<char*>(output.data());
    stream_.avail_out = static_cast<unsigned>(output.size());
    const int status = BZ2_bzDecompress(&stream_);
    if (status != BZ_OK && status != BZ_STREAM_END) {
      volume::throw_unusable(
          "The compressed data is corrupt: it cannot be unpacked, or its checksum is wrong.");
    }
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

std::uint64_t unzip2_range(const InputFile& file, const CompressedRange& range, std::uint64_t limit,
                           const ByteSink& sink) {
  std::vector<std::byte> piece(kBufferBytes);
  std::vector<std::byte> output(kBufferBytes);
  std::span<std::byte> input;
  std::uint64_t next = range.offset;
  const std::uint64_t end = range.offset + range.bytes;
  const auto refill = [&] {
    if (!input.empty()) return true;
    const std::size_t wanted = std::min<std::uint64_t>(piece.size(), end - next);
    input = std::span(piece).first(file.read(next, std::span(piece).first(wanted)));
    next += input.size();
    return !input.empty();
  };
  std::uint64_t produced = 0;
  do {
    Stream stream;
    // After a full output the library may hold back decoded bytes.
    bool is_full = false;
    for (bool is_over = false; !is_over;) {
      if (!is_full && !refill()) {
        volume::throw_unusable("The compressed data is truncated: the file ends too early.");
      }
      const std::size_t count = stream.decode(input, output, is_over);
      is_full = count == output.size();
      if (count > limit - produced) return limit + 1;
      produced += count;
      if (count > 0) sink(std::span(output).first(count));
    }
  } while (refill() && input.front() == std::byte{'B'});
  do {
    if (!is_padding(input)) {
      volume::throw_unusable("The compressed data is followed by data that is not part of it.");
    }
    input = {};
  } while (refill());
  return produced;
}

}  // namespace isomesh::import
