#include "server/hospital/orders/pattern.h"

namespace isomesh::orders {
namespace {

char lower_of(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

// The bytes of the character at that place, in UTF-8.
std::size_t character_bytes(std::string_view text, std::size_t at) {
  constexpr unsigned kMask = 0xC0;
  constexpr unsigned kContinuation = 0x80;
  std::size_t end = at + 1;
  while (end < text.size() && (static_cast<unsigned char>(text[end]) & kMask) == kContinuation) {
    ++end;
  }
  return end - at;
}

bool matches_by(std::string_view pattern, std::string_view text, bool (*are_equal)(char, char)) {
  // The last * seen, and the end of the text it matches so far: backtracking only ever extends that
  // match.
  std::size_t star = std::string_view::npos;
  std::size_t star_text = 0;
  std::size_t p = 0;
  std::size_t t = 0;
  while (t < text.size()) {
    if (p < pattern.size() && pattern[p] == '*') {
      star = p++;
      star_text = t;
    } else if (p < pattern.size() && pattern[p] == '?') {
      ++p;
      t += character_bytes(text, t);
    } else if (p < pattern.size() && are_equal(pattern[p], text[t])) {
      ++p;
      ++t;
    } else if (star != std::string_view::npos) {
      p = star + 1;
      t = ++star_text;
    } else {
      return false;
    }
  }
  return pattern.substr(p).find_first_not_of('*') == std::string_view::npos;
}

}  // namespace

bool matches(std::string_view pattern, std::string_view text) {
  return matches_by(pattern, text, [](char a, char b) { return lower_of(a) == lower_of(b); });
}

bool matches_case(std::string_view pattern, std::string_view text) {
  return matches_by(pattern, text, [](char a, char b) { return a == b; });
}

}  // namespace isomesh::orders
