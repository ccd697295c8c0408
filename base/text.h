// Parsing of lines, words and numbers, independent of the locale. Pure functions. Returned views
// refer to the argument.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace isomesh {

// Removes white space at both ends.
std::string_view trimmed(std::string_view text);
std::string lower(std::string_view text);  // ASCII only

// In ASCII.
constexpr bool is_letter_or_digit(char c) {
  return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}

bool is_digits(std::string_view text);

// A letter, a digit, a dot, a dash or an underscore: a path and a file name take them as they are.
constexpr bool is_plain(char c) {
  return is_letter_or_digit(c) || c == '.' || c == '-' || c == '_';
}

// True if a UTF-8 text has characters that are invisible and not allowed in XML: control characters
// other than tabs, or noncharacters (Unicode 15, 23.7).
bool has_control_characters(std::string_view text);

// Replaces tabs and the characters of has_control_characters() by U+FFFD.
std::string printable(std::string_view text);
// The same, but line breaks stay.
std::string printable_lines(std::string_view text);

// The longest prefix of a UTF-8 text of at most `most_bytes` bytes that does not split a character.
std::string_view beginning(std::string_view text, std::size_t most_bytes);

// The parts between separators, trimmed; one more than there are separators.
std::vector<std::string_view> split(std::string_view text, char separator);

std::vector<std::string_view> words(std::string_view text);

// The lines that are not only white space, trimmed.
std::vector<std::string_view> lines(std::string_view text);

// The whole of `text` as a number; empty if it is not one.
std::optional<double> parse_double(std::string_view text);
std::optional<std::int64_t> parse_int64(std::string_view text);
std::optional<std::uint64_t> parse_uint64(std::string_view text);

// The shortest text that reads back as the same number.
std::string to_text(double value);

// A header's value, safe to repeat to a client: printable ASCII, at most 40 characters, in quotes.
std::string in_quotes(std::string_view text);

// Encodes every byte that is not unreserved in RFC 3986 as %XX.
std::string percent_encode(std::string_view text);

}  // namespace isomesh
