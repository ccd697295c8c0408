#include "base/text.h"

#include <algorithm>
#include <array>
#include <charconv>

namespace isomesh {
namespace {

constexpr std::string_view kSpace = " \t\r\n\v\f";

template <class Number>
std::optional<Number> parse(std::string_view text) {
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
  Number value{};
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (text.empty() || error != std::errc{} || stop != end) return std::nullopt;
  return value;
}

// The length in UTF-8 of the control character or noncharacter at the start of the text; 0 if it
// starts with neither.
std::size_t unseen_bytes(std::string_view text) {
  const auto byte = [&](std::size_t at) -> unsigned {
    return at < text.size() ? static_cast<unsigned char>(text[at]) : 0;
  };
  if (byte(0) < 0x20 || byte(0) == 0x7F) return 1;
  if (byte(0) == 0xC2 && byte(1) >= 0x80 && byte(1) < 0xA0) return 2;  // U+0080 to U+009F
  if (byte(0) == 0xEF && byte(1) == 0xB7 && byte(2) >= 0x90 && byte(2) < 0xB0)
    return 3;  // U+FDD0 to U+FDEF
  // The last two of every plane: U+FFFE, U+FFFF, U+1FFFE, ...
  if (byte(0) == 0xEF && byte(1) == 0xBF && byte(2) >= 0xBE) return 3;
  const bool ends_a_plane =
      byte(0) >= 0xF0 && (byte(1) & 0xCFU) == 0x8F && byte(2) == 0xBF && byte(3) >= 0xBE;
  return ends_a_plane ? 4 : 0;
}

}  // namespace

std::string_view trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(kSpace);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kSpace) - first + 1);
}

bool is_digits(std::string_view text) {
  return !text.empty() && text.find_first_not_of("0123456789") == text.npos;
}

std::string lower(std::string_view text) {
  std::string result(text);
  for (char& letter : result) {
    if (letter >= 'A' && letter <= 'Z') letter = static_cast<char>(letter - 'A' + 'a');
  }
  return result;
}

bool has_control_characters(std::string_view text) {
  for (; !text.empty(); text.remove_prefix(1)) {
    if (text.front() != '\t' && unseen_bytes(text) > 0) return true;
  }
  return false;
}

std::string printable(std::string_view text) {
  std::string result;
  while (!text.empty()) {
    const std::size_t unseen = unseen_bytes(text);
    if (unseen > 0) {
      result += "\xef\xbf\xbd";
    } else {
      result += text.front();
    }
    text.remove_prefix(std::max<std::size_t>(unseen, 1));
  }
  return result;
}

std::string printable_lines(std::string_view text) {
  std::string lines;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    lines += (begin == 0 ? "" : "\n") + printable(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return lines;
}

std::string_view beginning(std::string_view text, std::size_t most_bytes) {
  if (text.size() <= most_bytes) return text;
  const auto continues = [](char byte) {
    return (static_cast<unsigned char>(byte) & 0xC0U) == 0x80;
  };
  while (most_bytes > 0 && continues(text[most_bytes])) --most_bytes;
  return text.substr(0, most_bytes);
}

std::vector<std::string_view> split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(separator, begin), text.size());
    parts.push_back(trimmed(text.substr(begin, end - begin)));
    begin = end + 1;
  }
  return parts;
}

std::vector<std::string_view> words(std::string_view text) {
  std::vector<std::string_view> result;
  for (std::size_t next = text.find_first_not_of(kSpace); next != std::string_view::npos;) {
    const std::size_t end = std::min(text.find_first_of(kSpace, next), text.size());
    result.push_back(text.substr(next, end - next));
    next = text.find_first_not_of(kSpace, end);
  }
  return result;
}

std::vector<std::string_view> lines(std::string_view text) {
  std::vector<std::string_view> result;
  for (std::size_t next = 0; next < text.size();) {
    const std::size_t end = std::min(text.find('\n', next), text.size());
    const std::string_view line = trimmed(text.substr(next, end - next));
    if (!line.empty()) result.push_back(line);
    next = end + 1;
  }
  return result;
}

std::optional<double> parse_double(std::string_view text) { return parse<double>(text); }
std::optional<std::int64_t> parse_int64(std::string_view text) { return parse<std::int64_t>(text); }
std::optional<std::uint64_t> parse_uint64(std::string_view text) {
  return parse<std::uint64_t>(text);
}

std::string to_text(double value) {
  std::array<char, 32> buffer;
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr;
  return {buffer.data(), end};
}

std::string in_quotes(std::string_view text) {
  constexpr std::size_t kLongest = 40;
  std::string result = "\"";
  for (const char letter : text.substr(0, kLongest)) {
    result += letter >= ' ' && letter <= '~' && letter != '"' ? letter : '?';
  }
  return result + (text.size() > kLongest ? "...\"" : "\"");
}

std::string percent_encode(std::string_view text) {
  constexpr std::string_view kDigits = "0123456789ABCDEF";
  std::string encoded;
  for (const char c : text) {
    if (is_plain(c) || c == '~') {
      encoded += c;
    } else {
      const auto byte = static_cast<unsigned char>(c);
      encoded.append({'%', kDigits[byte >> 4], kDigits[byte & 15]});
    }
  }
  return encoded;
}

}  // namespace isomesh
