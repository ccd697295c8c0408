// Decodes a chunked body while it arrives (RFC 9112, 7.1).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace isomesh::net {

// Ignores extensions and trailer fields, but checks their syntax. Accepts blanks before the end of
// a chunk's size, which older clients write.
//
// A client can send unlimited bytes that are not data: digits of a chunk's size, extensions,
// trailer fields. All are bounded.
//
// A plain value. Looks at each byte of the framing once.
class ChunkDecoder {
 public:
  static constexpr std::size_t kLongestLine = 256;
  static constexpr std::size_t kMostExtensions = 64 * 1024;  // total bytes
  static constexpr std::size_t kMostTrailers = 8192;

  // Moves the data among the next bytes of the body to their beginning, and returns its size.
  // Empty, from then on always, if they are not a chunked body. Ignores what follows the body.
  std::optional<std::size_t> decode(std::span<char> bytes);

  // True after the last chunk and its trailers.
  bool is_over() const { return state_ == State::kOver; }

 private:
  enum class State {
    kSize,
    kExtension,  // before its name
    kName,
    kAfterName,
    kValue,  // before it
    kToken,
    kQuoted,
    kEscaped,
    kBlank,
    kSizeEnd,
    kData,
    kDataReturn,
    kDataEnd,
    kTrailer,  // before its name, or the empty line
    kTrailerName,
    kTrailerValue,
    kTrailerEnd,
    kEnd,
    kOver,
    kBroken,
  };

  State after(char c);
  static State after_part(char c);
  State after_size_line();
  bool is_too_long();

  State state_ = State::kSize;
  std::uint64_t size_ = 0;      // of the chunk, then its remaining bytes
  bool has_size_ = false;       // a digit
  std::size_t line_ = 0;        // length of a chunk's line
  std::size_t extensions_ = 0;  // bytes of chunks' extensions
  std::size_t trailers_ = 0;    // bytes of trailer fields
};

}  // namespace isomesh::net
