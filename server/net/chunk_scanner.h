// Checks the framing of a chunked body while it passes (RFC 9112, 7.1).
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace isomesh::net {

// A client can send unlimited bytes that are not data: digits of a chunk's size, extensions,
// trailer fields. The HTTP library reads each as a line of any length; here all are bounded.
//
// A plain value. Looks at each byte once.
class ChunkScanner {
 public:
  static constexpr std::size_t kLongestLine = 256;
  static constexpr std::size_t kMostExtensions = 64 * 1024;  // total bytes
  static constexpr std::size_t kMostTrailers = 8192;

  // Checks the next bytes of the body. Returns false, from then on always, if they are not a
  // chunked body.
  bool scan(std::string_view bytes);

  // True after the last chunk and its trailers.
  bool is_over() const { return state_ == State::kOver; }

 private:
  enum class State { kSize, kExtension, kSizeEnd, kData, kDataEnd, kTrailers, kOver, kBroken };

  State after(char c);
  State after_size();
  State after_line();

  State state_ = State::kSize;
  std::uint64_t size_ = 0;  // of the chunk, then its remaining bytes
  std::size_t digits_ = 0;  // of the size
  std::size_t line_ = 0;    // length of the current line
  std::size_t extensions_ = 0;
  std::size_t trailers_ = 0;  // bytes of trailer fields
};

}  // namespace isomesh::net
