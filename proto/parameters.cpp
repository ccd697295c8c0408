#include "proto/parameters.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>

namespace isomesh {

const char* smoothing_methods() {
  static const std::string text = [] {
    std::string all;
    for (const SmoothingRow& row : kSmoothings)
      all += (all.empty() ? "" : " ") + std::string(row.more);
    return all;
  }();
  return text.c_str();
}

Meanings smoothing_meanings() {
  Meanings meanings = {};
  static_assert(kSmoothings.size() <= meanings.size());
  std::ranges::transform(kSmoothings, meanings.begin(), &SmoothingRow::meaning);
  return meanings;
}

SmoothingCases lambda_cases() {
  SmoothingCases cases;
  for (const SmoothingRow& row : kSmoothings) {
    if (row.lambda) cases.push_back({row.smoothing, row.lambda, row.most_lambda});
  }
  return cases;
}

SmoothingCases pass_band_cases() {
  SmoothingCases cases;
  for (const SmoothingRow& row : kSmoothings) {
    if (row.has_pass_band) cases.push_back({row.smoothing});
  }
  return cases;
}

std::string query_name_of(const Parameter& parameter) {
  return parameter.query == nullptr ? parameter.name : parameter.query;
}

std::string option_name_of(const Parameter& parameter) {
  if (parameter.option != nullptr) return parameter.option;
  std::string name = query_name_of(parameter);
  const std::string unit = std::string("_") + parameter.unit;
  if (unit.size() > 1 && name.ends_with(unit)) name.resize(name.size() - unit.size());
  std::ranges::replace(name, '_', '-');
  return name;
}

std::string range_of(const Parameter& parameter) {
  std::string text;
  if (parameter.minimum) {
    text = parameter.maximum ? "from " : "of at least ";
    text += number_text(*parameter.minimum);
  } else if (parameter.above) {
    text = "above " + number_text(*parameter.above);
  }
  if (!parameter.maximum) return text;
  text += parameter.minimum ? " to " : text.empty() ? "of at most " : " and at most ";
  return text + number_text(*parameter.maximum);
}

std::string must_be(const Parameter& parameter, bool is_whole) {
  // Without an upper bound, "a number" would include the infinite ones.
  const std::string kind = is_whole            ? "whole number"
                           : parameter.maximum ? "number"
                                               : "finite number";
  const std::string range = range_of(parameter);
  const std::string word =
      parameter.when_empty == nullptr ? "" : " or \"" + std::string(parameter.when_empty) + '"';
  return "must be a " + kind + (range.empty() ? "" : ' ' + range) + word;
}

std::string number_text(double number) {
  constexpr double kWholeBelow = 1e15;
  std::array<char, 32> digits = {};
  const bool is_whole = std::floor(number) == number && std::abs(number) < kWholeBelow;
  const auto end =
      is_whole ? std::to_chars(digits.begin(), digits.end(), static_cast<std::int64_t>(number)).ptr
               : std::to_chars(digits.begin(), digits.end(), number).ptr;
  return {digits.data(), end};
}

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t n = 0; n < names.size(); ++n) {
    if (n > 0) text += n + 1 == names.size() ? " or " : ", ";
    text += names[n];
  }
  return text;
}

}  // namespace isomesh
