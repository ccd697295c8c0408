// Inflates gzip, zlib and bare deflate streams, with bounded memory and a bounded output.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>

#include "base/files.h"

namespace isomesh::import {

// True for bytes that begin a gzip stream.
bool is_gzip(std::span<const std::byte> head);

// Inflates the head of a gzip file, up to `count` bytes. Empty when it is no gzip. Never throws
// because of the input, which may end or be damaged anywhere.
std::string inflate_head(std::span<const std::byte> head, std::size_t count);

// Where a compressed stream lies in a file.
struct CompressedRange {
  std::uint64_t offset = 0;
  std::uint64_t bytes = 0;
};

// The header and checksum around the compressed data. DICOM's deflated files have none, but for a
// checksum that some writers leave behind them.
enum class Wrapping { kZlibOrGzip, kNone };

// Takes the inflated bytes piece by piece, in order.
using ByteSink = std::function<void(std::span<const std::byte>)>;

// Inflates the stream that fills the range, or several gzip streams that follow one another, into
// `sink`; zero bytes may follow them, and gzip's trailer bare deflated data. Stops before more than
// `limit` bytes have gone to the sink. Returns how many went, or `limit` + 1 when there are more.
// Throws Error kUnusableVolume when the stream is corrupt, ends early, fails its checksum or is
// followed by anything but zeros.
std::uint64_t inflate_range(const InputFile& file, const CompressedRange& range,
                            std::uint64_t limit, const ByteSink& sink,
                            Wrapping wrapping = Wrapping::kZlibOrGzip);

}  // namespace isomesh::import
