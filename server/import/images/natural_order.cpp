#include "server/import/images/natural_order.h"

#include <algorithm>
#include <cstdint>
#include <optional>

#include "base/text.h"

namespace isomesh::import {
namespace {

bool is_digit(char letter) { return letter >= '0' && letter <= '9'; }

// The digits, or the letters up to the next digit, at the front of the text.
std::string_view first_part(std::string_view text) {
  std::size_t size = 1;
  while (size < text.size() && is_digit(text[size]) == is_digit(text[0])) ++size;
  return text.substr(0, size);
}

std::string_view without_zeros(std::string_view digits) {
  return digits.substr(std::min(digits.find_first_not_of('0'), digits.size()));
}

int compare_numbers(std::string_view one, std::string_view other) {
  const std::string_view a = without_zeros(one);
  const std::string_view b = without_zeros(other);
  if (a.size() != b.size()) return a.size() < b.size() ? -1 : 1;
  return a.compare(b);
}

// A name as the text around its only number that differs from another name's.
struct Numbered {
  std::string_view before;
  std::string_view digits;
  std::string_view after;
};

std::optional<Numbered> number_between(std::string_view name, std::string_view other) {
  std::size_t begin = 0;
  while (begin < std::min(name.size(), other.size()) && name[begin] == other[begin]) ++begin;
  while (begin > 0 && is_digit(name[begin - 1])) --begin;
  std::size_t end = begin;
  while (end < name.size() && is_digit(name[end])) ++end;
  if (end == begin) return std::nullopt;
  return Numbered{name.substr(0, begin), name.substr(begin, end - begin), name.substr(end)};
}

std::optional<std::int64_t> number_of(const Numbered& numbered) {
  constexpr std::size_t kMostDigits = 15;
  const std::string_view digits = without_zeros(numbered.digits);
  if (digits.empty()) return 0;
  return digits.size() > kMostDigits ? std::nullopt : parse_int64(digits);
}

}  // namespace

bool comes_before(std::string_view one, std::string_view other) {
  const std::string_view whole_one = one;
  const std::string_view whole_other = other;
  while (!one.empty() && !other.empty()) {
    const std::string_view a = first_part(one);
    const std::string_view b = first_part(other);
    const bool are_numbers = is_digit(a[0]) && is_digit(b[0]);
    const int order = are_numbers ? compare_numbers(a, b) : a.compare(b);
    if (order != 0) return order < 0;
    one.remove_prefix(a.size());
    other.remove_prefix(b.size());
  }
  if (one.empty() && other.empty()) return whole_one < whole_other;
  return one.empty();
}

std::string missing_between(const std::vector<std::string>& sorted) {
  if (sorted.size() < 3) return {};
  std::vector<std::int64_t> numbers;
  std::optional<Numbered> first;
  for (std::size_t at = 0; at < sorted.size(); ++at) {
    const auto part = number_between(sorted[at], at == 0 ? sorted.back() : sorted.front());
    const auto number = part ? number_of(*part) : std::nullopt;
    if (!number) return {};
    if (!first) first = part;
    if (part->before != first->before || part->after != first->after) return {};
    numbers.push_back(*number);
  }
  std::int64_t step = numbers[1] - numbers[0];
  for (std::size_t at = 2; at < numbers.size(); ++at) {
    step = std::min(step, numbers[at] - numbers[at - 1]);
  }
  if (step < 1) return {};
  for (std::size_t at = 1; at < numbers.size(); ++at) {
    if (numbers[at] - numbers[at - 1] == step) continue;
    std::string number = std::to_string(numbers[at - 1] + step);
    const std::size_t width = first->digits.size();
    number.insert(0, width - std::min(width, number.size()), '0');
    return std::string(first->before) + number + std::string(first->after);
  }
  return {};
}

}  // namespace isomesh::import
