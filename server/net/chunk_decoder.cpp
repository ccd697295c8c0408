#include "server/net/chunk_decoder.h"

#include <algorithm>

#include "server/net/request_head.h"

namespace isomesh::net {
namespace {

// The value of a hexadecimal digit; -1 for other characters.
int digit_of(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

bool is_blank(char c) { return c == ' ' || c == '\t'; }

}  // namespace

std::optional<std::size_t> ChunkDecoder::decode(std::span<char> bytes) {
  std::size_t decoded = 0;
  for (std::size_t at = 0; at < bytes.size() && state_ != State::kOver;) {
    if (state_ == State::kBroken) break;
    if (state_ != State::kData) {
      state_ = is_too_long() ? State::kBroken : after(bytes[at]);
      ++at;
      continue;
    }
    const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(size_, bytes.size() - at));
    if (at != decoded) std::copy_n(bytes.begin() + at, count, bytes.begin() + decoded);
    decoded += count;
    at += count;
    size_ -= count;
    if (size_ == 0) state_ = State::kDataReturn;
  }
  if (state_ == State::kBroken) return std::nullopt;
  return decoded;
}

// Counts the next byte, which is not data.
bool ChunkDecoder::is_too_long() {
  if (state_ >= State::kTrailer) return ++trailers_ > kMostTrailers;
  if (state_ >= State::kExtension && state_ <= State::kBlank) ++extensions_;
  return ++line_ > kLongestLine || extensions_ > kMostExtensions;
}

ChunkDecoder::State ChunkDecoder::after(char c) {
  constexpr std::uint64_t kMostBytes = std::uint64_t{1} << 60;
  switch (state_) {
    case State::kSize:
      if (const int digit = digit_of(c); digit >= 0) {
        has_size_ = true;
        size_ = size_ * 16 + static_cast<std::uint64_t>(digit);
        return size_ < kMostBytes ? State::kSize : State::kBroken;
      }
      return has_size_ ? after_part(c) : State::kBroken;
    case State::kExtension:
      if (is_blank(c)) return State::kExtension;
      return is_token_character(c) ? State::kName : State::kBroken;
    case State::kName:
      if (is_token_character(c)) return State::kName;
      return is_blank(c) ? State::kAfterName : c == '=' ? State::kValue : after_part(c);
    case State::kAfterName:
      if (is_blank(c)) return State::kAfterName;
      return c == '=' ? State::kValue : after_part(c);
    case State::kValue:
      if (is_blank(c)) return State::kValue;
      if (c == '"') return State::kQuoted;
      return is_token_character(c) ? State::kToken : State::kBroken;
    case State::kToken:
      return is_token_character(c) ? State::kToken : after_part(c);
    case State::kQuoted:
      if (c == '"') return State::kBlank;
      if (is_control(c)) return State::kBroken;
      return c == '\\' ? State::kEscaped : State::kQuoted;
    case State::kEscaped:
      return is_control(c) ? State::kBroken : State::kQuoted;
    case State::kBlank:
      return after_part(c);
    case State::kSizeEnd:
      return c == '\n' ? after_size_line() : State::kBroken;
    case State::kDataReturn:
      return c == '\r' ? State::kDataEnd : State::kBroken;
    case State::kDataEnd:
      line_ = 0;
      return c == '\n' ? State::kSize : State::kBroken;
    case State::kTrailer:
      if (c == '\r') return State::kEnd;
      return is_token_character(c) ? State::kTrailerName : State::kBroken;
    case State::kTrailerName:
      if (is_token_character(c)) return State::kTrailerName;
      return c == ':' ? State::kTrailerValue : State::kBroken;
    case State::kTrailerValue:
      if (c == '\r') return State::kTrailerEnd;
      return is_control(c) ? State::kBroken : State::kTrailerValue;
    case State::kTrailerEnd:
      return c == '\n' ? State::kTrailer : State::kBroken;
    case State::kEnd:
      return c == '\n' ? State::kOver : State::kBroken;
    default:
      return state_;
  }
}

// The bytes that may follow a size, a name and a value.
ChunkDecoder::State ChunkDecoder::after_part(char c) {
  if (c == ';') return State::kExtension;
  if (c == '\r') return State::kSizeEnd;
  return is_blank(c) ? State::kBlank : State::kBroken;
}

ChunkDecoder::State ChunkDecoder::after_size_line() {
  has_size_ = false;
  line_ = 0;
  return size_ == 0 ? State::kTrailer : State::kData;
}

}  // namespace isomesh::net
