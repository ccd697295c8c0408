// Text of headers and queries: lines, words and numbers, independent of the locale. Pure functions;
// views that are returned are views of the argument.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace isomesh {

// Without the white space around it.
std::string_view trimmed(std::string_view text);
std::string lower(std::string_view text);  // ASCII only

// True if a text that is UTF-8 has what nobody can see and XML cannot hold: control characters
// other than tabs, or noncharacters (Unicode 15, 23.7).
bool has_control_characters(std::string_view text);

// A text that is UTF-8, or should be, with U+FFFD for each of those, and for tabs.
std::string printable(std::string_view text);

// The beginning of a text that is UTF-8, of at most so many bytes, without half a character.
std::string_view beginning(std::string_view text, std::size_t most_bytes);

// The parts between separators, each without the white space around it; one more than there are
// separators.
std::vector<std::string_view> split(std::string_view text, char separator);

// The words between white space.
std::vector<std::string_view> words(std::string_view text);

// The lines that hold more than white space, without what surrounds it.
std::vector<std::string_view> lines(std::string_view text);

// The whole of `text` as a number; empty when it is anything else.
std::optional<double> parse_double(std::string_view text);
std::optional<std::int64_t> parse_int64(std::string_view text);
std::optional<std::uint64_t> parse_uint64(std::string_view text);

// A number as a person reads it: the shortest text that is read back as the same.
std::string to_text(double value);

// What may be repeated to a client from a header: printable ASCII, at most 40 characters, in
// quotes.
std::string in_quotes(std::string_view text);

// "i", "j" or "k", or "4", "5", ... beyond.
std::string axis_name(std::size_t axis);

}  // namespace isomesh
