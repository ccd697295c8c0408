#include "server/import/formats/nrrd_numbers.h"

#include <algorithm>
#include <cstdlib>
#include <string>

#include "base/text.h"
#include "server/import/source/names.h"

namespace isomesh::import {
namespace {

constexpr std::string_view kSpaces = " \t";

// Parses a number as the format's own library does: any word with "nan" is unknown, and text after
// a number is ignored. Empty if there is no number.
std::optional<double> number_of(std::string_view word) {
  const std::string text = lower(word);
  if (text.find("nan") != std::string::npos) return kUnknown;
  if (text.find("inf") != std::string::npos) return std::numeric_limits<double>::infinity();
  char* end = nullptr;
  const double number = std::strtod(text.c_str(), &end);
  if (end == text.c_str()) return std::nullopt;
  return number;
}

// The numbers of a vector; all are known or none.
std::optional<std::vector<double>> parse_vector(std::string_view inside, std::size_t size) {
  std::vector<double> numbers;
  std::size_t known = 0;
  for (std::size_t next = 0; next <= inside.size();) {
    const std::size_t end = std::min(inside.find(',', next), inside.size());
    const std::string_view part = inside.substr(next, end - next);
    next = end + 1;
    if (part.empty()) continue;
    const auto number = number_of(part);
    if (!number || std::isinf(*number)) return std::nullopt;
    numbers.push_back(*number);
    if (is_known(*number)) ++known;
  }
  if (numbers.size() != size || (known != 0 && known != size)) return std::nullopt;
  return numbers;
}

}  // namespace

void throw_not_understood(std::string_view name, std::string_view value) {
  throw_unusable("The NRRD header's " + in_quotes(name) + " cannot be read: " + in_quotes(value) +
                 ".");
}

std::vector<double> axis_numbers(const NrrdFields& fields, std::string_view name,
                                 std::size_t axes) {
  const std::string_view value = value_of(fields, name);
  if (value.empty()) return std::vector<double>(axes, kUnknown);
  const auto said = words(value);
  std::vector<double> numbers;
  for (std::size_t axis = 0; axis < std::min(axes, said.size()); ++axis) {
    const auto number = number_of(said[axis]);
    if (!number || std::isinf(*number)) throw_not_understood(name, value);
    numbers.push_back(*number);
  }
  const bool has_more = said.size() > axes && number_of(said[axes]);
  if (numbers.size() < axes || has_more) throw_not_understood(name, value);
  return numbers;
}

std::vector<std::string_view> axis_words(const NrrdFields& fields, std::string_view name,
                                         std::size_t axes) {
  const std::string_view value = value_of(fields, name);
  const auto said = words(value);
  if (!said.empty() && said.size() != axes) throw_not_understood(name, value);
  return said;
}

void skip_spaces(std::string_view& rest) {
  rest.remove_prefix(std::min(rest.find_first_not_of(kSpaces), rest.size()));
}

std::optional<std::vector<double>> take_vector(std::string_view& rest, std::size_t size) {
  constexpr std::string_view kNone = "none";
  skip_spaces(rest);
  if (rest.starts_with(kNone)) {
    rest.remove_prefix(kNone.size());
    if (!rest.empty() && kSpaces.find(rest.front()) == std::string_view::npos) return std::nullopt;
    return std::vector<double>(size, kUnknown);
  }
  const std::size_t end = rest.find(')');
  if (!rest.starts_with('(') || end == std::string_view::npos) return std::nullopt;
  const std::string_view inside = rest.substr(1, end - 1);
  rest.remove_prefix(end + 1);
  return parse_vector(inside, size);
}

}  // namespace isomesh::import
