// Unpacks gzip, zlib, raw deflate and bzip2 streams with bounded memory and output.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>

#include "base/files.h"

namespace isomesh::import {

// Files are read, inflated and converted in pieces of this size.
inline constexpr std::size_t kPieceBytes = std::size_t{1} << 18;

bool is_gzip(std::string_view head);

// Inflates up to `count` bytes of a gzip file's head. Empty if it is not gzip. Never throws because
// of the input, which may be truncated or damaged.
std::string inflate_head(std::string_view head, std::size_t count);

// The byte range of a compressed stream.
struct CompressedRange {
  std::uint64_t offset = 0;
  std::uint64_t bytes = 0;
};

// The header and checksum around the compressed data. DICOM's deflated files have none, except for
// a checksum that some writers append.
enum class Wrapping { kZlibOrGzip, kNone };

// Takes inflated bytes in order, in pieces.
using ByteSink = std::function<void(std::span<const std::byte>)>;

// Inflates the stream in the range, or several consecutive gzip streams, into `sink`. Zero bytes
// may follow; after raw deflate data also gzip's trailer. Stops before the sink has more than
// `limit` bytes. Returns the number of bytes, or `limit` + 1 if there are more. Throws Error
// kUnusableVolume if the stream is corrupt, truncated, fails its checksum or is followed by other
// bytes.
std::uint64_t inflate_range(const InputFile& file, const CompressedRange& range,
                            std::uint64_t limit, const ByteSink& sink,
                            Wrapping wrapping = Wrapping::kZlibOrGzip);

// Inflates a raw deflate stream in memory into `target`, up to its size. Returns the number of
// bytes. Throws Error kUnusableVolume, with a clause without a subject, if the stream is corrupt or
// truncated; bytes after the target's size are not read.
std::size_t inflate_bytes(std::span<const std::byte> stream, std::span<std::byte> target);

// As inflate_range, for one bzip2 stream or several consecutive ones.
std::uint64_t unzip2_range(const InputFile& file, const CompressedRange& range, std::uint64_t limit,
                           const ByteSink& sink);

}  // namespace isomesh::import
