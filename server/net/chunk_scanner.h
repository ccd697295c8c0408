// The framing of a chunked body, checked as it passes by (RFC 9112, 7.1).
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace isomesh::net {

// A client can spend for ever on what is no data: the digits of a chunk's size, its extensions, the
// fields after the last chunk. The HTTP library reads each as one line of any length; here each has
// a bound.
//
// Plain value; looks at every byte once.
class ChunkScanner {
 public:
  static constexpr std::size_t kLongestLine = 256;
  static constexpr std::size_t kMostExtensions = 64 * 1024;  // bytes of all together
  static constexpr std::size_t kMostTrailers = 8192;

  // Looks at the next bytes of the body. False when they cannot be a chunked body, and ever after.
  bool scan(std::string_view bytes);

  // Whether the last chunk and what follows it have come.
  bool is_over() const { return state_ == State::kOver; }

 private:
  enum class State { kSize, kExtension, kSizeEnd, kData, kDataEnd, kTrailers, kOver, kBroken };

  State after(char c);
  State after_size();
  State after_line();

  State state_ = State::kSize;
  std::uint64_t size_ = 0;  // of the chunk, and then what is left of it
  std::size_t digits_ = 0;  // of the size
  std::size_t line_ = 0;    // bytes of the line so far
  std::size_t extensions_ = 0;
  std::size_t trailers_ = 0;  // bytes of the fields after the last chunk
};

}  // namespace isomesh::net
