#include "server/import/formats/file_pattern.h"

#include <cstdint>
#include <optional>

#include "base/text.h"
#include "server/import/source/source.h"

namespace isomesh::import {
namespace {

constexpr std::int64_t kLargestNumber = 1'000'000'000;
constexpr std::int64_t kMostFiles = 65'536;
constexpr std::size_t kWidestNumber = 9;
constexpr std::size_t kLongestPattern = 4096;  // there is a copy of it for each file

[[noreturn]] void throw_no_pattern(std::string_view said) {
  throw_unusable("The header names its data files by " + in_quotes(said) +
                 ", which is not a pattern such as \"slice%03d.raw 1 93 1\".");
}

// The text around the number, and the format of its digits.
struct Pattern {
  std::string_view before;
  std::string_view after;
  std::size_t width = 0;
  char filling = ' ';

  std::string name(std::int64_t number) const {
    std::string digits = std::to_string(number);
    if (digits.size() < width) digits.insert(0, width - digits.size(), filling);
    return std::string(before) + digits + std::string(after);
  }
};

std::optional<Pattern> parse_pattern(std::string_view text) {
  if (text.size() > kLongestPattern) return std::nullopt;
  const std::size_t percent = text.find('%');
  const std::size_t letter = text.find_first_not_of("0123456789", percent + 1);
  if (percent == text.npos || letter == text.npos) return std::nullopt;
  if (std::string_view("diu").find(text[letter]) == std::string_view::npos) return std::nullopt;
  Pattern pattern = {.before = text.substr(0, percent), .after = text.substr(letter + 1)};
  if (pattern.after.find('%') != std::string_view::npos) return std::nullopt;
  const std::string_view width = text.substr(percent + 1, letter - percent - 1);
  if (width.starts_with('0')) pattern.filling = '0';
  pattern.width = width.empty() ? 0 : parse_uint64(width).value_or(kWidestNumber + 1);
  if (pattern.width > kWidestNumber) return std::nullopt;
  return pattern;
}

}  // namespace

bool is_file_pattern(std::string_view said) { return said.find('%') != std::string_view::npos; }

std::vector<std::string> expand_file_pattern(std::string_view said) {
  const std::vector<std::string_view> parts = words(said);
  if (parts.size() < 3 || parts.size() > 5) throw_no_pattern(said);
  const auto pattern = parse_pattern(parts[0]);
  if (!pattern) throw_no_pattern(said);
  std::vector<std::int64_t> numbers;
  for (std::size_t at = 1; at < parts.size(); ++at) {
    const auto number = parse_int64(parts[at]);
    if (!number || *number < -kLargestNumber || *number > kLargestNumber) throw_no_pattern(said);
    numbers.push_back(*number);
  }
  const std::int64_t first = numbers[0];
  const std::int64_t last = numbers[1];
  const std::int64_t step = numbers.size() > 2 ? numbers[2] : 1;
  if (first < 0 || last < 0 || step == 0 || (last - first) * step < 0) throw_no_pattern(said);
  const std::int64_t count = (last - first) / step + 1;
  if (count > kMostFiles) {
    throw_unusable("The header names " + std::to_string(count) + " data files. At most " +
                   std::to_string(kMostFiles) + " are supported.");
  }
  std::vector<std::string> names;
  for (std::int64_t at = 0; at < count; ++at) names.push_back(pattern->name(first + at * step));
  return names;
}

}  // namespace isomesh::import
