// Formats that are text, in lines; private to this folder.
#pragma once

#include <algorithm>
#include <array>
#include <charconv>
#include <cstddef>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "server/codec/decode/formats.h"

namespace isomesh::codec::decoding {

// Calls visit(line) for each, without its end.
template <class Visit>
void for_each_line(std::string_view text, const Visit& visit) {
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    visit(text.substr(at, end - at));
    at = end + 1;
  }
}

// Whole lines each, of a megabyte or so.
inline std::vector<std::string_view> cut_lines(std::string_view text) {
  constexpr std::size_t kBytesPerPiece = std::size_t{1} << 20;
  std::vector<std::string_view> pieces;
  while (!text.empty()) {
    std::size_t end = text.size();
    if (end > kBytesPerPiece) end = std::min(text.find('\n', kBytesPerPiece), end - 1) + 1;
    pieces.push_back(text.substr(0, end));
    text.remove_prefix(end);
  }
  return pieces;
}

// The numbers that are all of the text, with one blank between two.
template <class T, std::size_t N>
std::array<T, N> numbers_of(std::string_view text, MeshFormat format) {
  std::array<T, N> numbers;
  const char* at = text.data();
  const char* const end = text.data() + text.size();
  for (std::size_t n = 0; n < N; ++n) {
    const bool is_there = n == 0 || (at != end && *at == ' ');
    const char* const begin = is_there ? at + (n == 0 ? 0 : 1) : end;
    const auto [next, error] = std::from_chars(begin, end, numbers[n]);
    if (error != std::errc{}) {
      refuse(format, std::to_string(N) + " numbers are expected in \"" +
                         std::string(text.substr(0, 80)) + '"');
    }
    at = next;
  }
  if (at != end) refuse(format, "extra text follows \"" + std::string(text.substr(0, 80)) + '"');
  return numbers;
}

}  // namespace isomesh::codec::decoding
