// Formats numbers for the text formats. Private to this folder. Each function writes one number at
// `out`, which must have room for it, and returns its end.
#pragma once

#include <charconv>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace isomesh::codec {

// Fixed notation, because some readers do not know exponents: a sign, up to 39 digits before the
// point, or a point and up to 54 digits behind it.
inline constexpr std::size_t kMostFloatBytes = 64;
inline constexpr std::size_t kMostIndexBytes = 10;

inline char* write_number(float number, char* out) {
  return std::to_chars(out, out + kMostFloatBytes, number, std::chars_format::fixed).ptr;
}

// Below 10^10.
inline char* write_number(std::uint64_t number, char* out) {
  return std::to_chars(out, out + kMostIndexBytes, number).ptr;
}

inline char* write_text(std::string_view text, char* out) {
  return out + text.copy(out, text.size());
}

}  // namespace isomesh::codec
