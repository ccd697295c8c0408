#include "server/net/chunk_scanner.h"

#include <algorithm>

namespace isomesh::net {
namespace {

// The value of a hexadecimal digit; -1 for other characters.
int digit_of(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

}  // namespace

bool ChunkScanner::scan(std::string_view bytes) {
  while (!bytes.empty() && state_ != State::kBroken && state_ != State::kOver) {
    if (state_ == State::kData) {
      const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(size_, bytes.size()));
      size_ -= count;
      bytes.remove_prefix(count);
      if (size_ == 0) state_ = State::kDataEnd;
      continue;
    }
    state_ = after(bytes.front());
    bytes.remove_prefix(1);
  }
  return state_ != State::kBroken;
}

ChunkScanner::State ChunkScanner::after(char c) {
  constexpr std::size_t kMostDigits = 15;  // keeps sizes below 2^60
  if (++line_ > kLongestLine && state_ != State::kTrailers) return State::kBroken;
  switch (state_) {
    case State::kSize:
      if (const int digit = digit_of(c); digit >= 0) {
        size_ = size_ * 16 + static_cast<std::uint64_t>(digit);
        return ++digits_ > kMostDigits ? State::kBroken : State::kSize;
      }
      if (digits_ == 0) return State::kBroken;
      if (c == '\r') return State::kSizeEnd;
      return c == ';' || c == ' ' || c == '\t' ? State::kExtension : State::kBroken;
    case State::kExtension:
      if (c == '\n' || ++extensions_ > kMostExtensions) return State::kBroken;
      return c == '\r' ? State::kSizeEnd : State::kExtension;
    case State::kSizeEnd:
      return c == '\n' ? after_size() : State::kBroken;
    case State::kDataEnd:
      if (line_ == 1) return c == '\r' ? State::kDataEnd : State::kBroken;
      line_ = 0;
      return c == '\n' ? State::kSize : State::kBroken;
    case State::kTrailers:
      if (++trailers_ > kMostTrailers) return State::kBroken;
      return c == '\n' ? after_line() : State::kTrailers;
    default:
      return state_;
  }
}

ChunkScanner::State ChunkScanner::after_size() {
  digits_ = 0;
  line_ = 0;
  return size_ == 0 ? State::kTrailers : State::kData;
}

// An empty line ends the trailers.
ChunkScanner::State ChunkScanner::after_line() {
  constexpr std::size_t kEmpty = 2;
  const bool is_empty = line_ <= kEmpty;
  line_ = 0;
  return is_empty ? State::kOver : State::kTrailers;
}

}  // namespace isomesh::net
