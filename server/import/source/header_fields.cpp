#include "server/import/source/header_fields.h"

#include <cmath>

#include "base/text.h"
#include "server/import/source/names.h"

namespace isomesh::import {

std::optional<double> finite_number(std::string_view text) {
  const auto number = parse_double(text);
  return number && std::isfinite(*number) ? number : std::nullopt;
}

std::vector<double> finite_numbers(std::string_view text) { return finite_numbers_of(words(text)); }

std::uint64_t plausible_whole(double number, const std::string& what) {
  constexpr double kMost = 1e9;
  if (number >= 0 && number <= kMost && number == std::floor(number)) {
    return static_cast<std::uint64_t>(number);
  }
  throw_unusable(what + " is not plausible.");
}

void add_field(HeaderTexts& texts, std::string_view title, const std::string& name,
               std::string_view value) {
  if (has_control_characters(value)) {
    throw_unusable(std::string(title) + "'s field " + in_quotes(name) +
                   " contains control characters.");
  }
  if (!texts.emplace(name, value).second) {
    throw_unusable(std::string(title) + " has the field " + in_quotes(name) + " twice.");
  }
}

std::string_view required(const HeaderTexts& texts, std::string_view title, std::string_view name) {
  const std::string_view value = value_of(texts, name);
  if (value.empty()) throw_unusable(std::string(title) + " has no field " + in_quotes(name) + ".");
  return value;
}

std::vector<std::uint64_t> required_sizes(const HeaderTexts& texts, std::string_view title,
                                          std::string_view count, std::string_view sizes,
                                          std::uint64_t most) {
  const std::string_view told = required(texts, title, count);
  const auto axes = parse_uint64(told);
  std::vector<std::uint64_t> result;
  for (const std::string_view word : words(required(texts, title, sizes))) {
    const auto size = parse_uint64(word);
    if (!size) {
      throw_unusable(std::string(title) + "'s size " + in_quotes(word) + " is not a number.");
    }
    result.push_back(*size);
  }
  if (!axes || *axes < 1 || *axes > most || *axes != result.size()) {
    throw_unusable(std::string(title) + "'s " + std::string(count) + " is " + in_quotes(told) +
                   ", but it has " + std::to_string(result.size()) + " sizes.");
  }
  return result;
}

}  // namespace isomesh::import
