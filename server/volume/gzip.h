// gzip and zlib streams, inflated with bounded memory and a bound on what comes out.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>

#include "server/volume/files.h"

namespace isomesh::volume {

// True for bytes that begin a gzip stream.
bool is_gzip(std::span<const std::byte> head);

// As many of the first `count` bytes behind a compressed head as it holds; empty when it is no
// gzip. Never throws for the input's sake: the head may end anywhere.
std::string inflate_head(std::span<const std::byte> head, std::size_t count);

// Where a compressed stream lies in a file.
struct CompressedRange {
  std::uint64_t offset = 0;
  std::uint64_t bytes = 0;
};

// What stands around the compressed data; kNone is DICOM's way.
enum class Wrapping { kZlibOrGzip, kNone };

// Takes the inflated bytes piece by piece, in order.
using ByteSink = std::function<void(std::span<const std::byte>)>;

// Inflates the gzip, zlib or bare stream, or the several gzip streams behind one another, that fill
// the range, into `sink`; zero bytes may follow them. Stops before more than `limit` bytes have
// gone to the sink. Returns how many went, or `limit` + 1 when there are more. Throws Error
// kUnusableVolume when the stream is corrupt, ends early, fails its checksum or has something else
// behind it.
std::uint64_t inflate_range(const InputFile& file, const CompressedRange& range,
                            std::uint64_t limit, const ByteSink& sink,
                            Wrapping wrapping = Wrapping::kZlibOrGzip);

}  // namespace isomesh::volume
