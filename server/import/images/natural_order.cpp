#include "server/import/images/natural_order.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <numeric>
#include <optional>

#include "base/text.h"
#include "server/import/source/names.h"

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

// A number in a name, which may be decimal.
struct NameNumber {
  std::size_t begin = 0;
  std::size_t end = 0;
  bool has_minus = false;
  bool has_fraction = false;
  bool may_be_negative = false;  // the minus does not separate the number from a letter
  double value = 0;              // without the minus
};

// Digits with more than one dot are no decimal number.
std::size_t end_of_number(std::string_view name, std::size_t begin) {
  const auto end_of_digits = [&](std::size_t at) {
    while (at < name.size() && is_digit(name[at])) ++at;
    return at;
  };
  const auto continues = [&](std::size_t at) {
    return at + 1 < name.size() && name[at] == '.' && is_digit(name[at + 1]);
  };
  const std::size_t end = end_of_digits(begin);
  const bool follows_dot = begin > 1 && name[begin - 1] == '.' && is_digit(name[begin - 2]);
  if (follows_dot || !continues(end)) return end;
  const std::size_t whole = end_of_digits(end + 1);
  return continues(whole) ? end : whole;
}

std::vector<NameNumber> numbers_in(std::string_view name) {
  std::vector<NameNumber> numbers;
  for (std::size_t at = 0; at < name.size(); ++at) {
    if (!is_digit(name[at])) continue;
    NameNumber number = {.begin = at, .end = end_of_number(name, at)};
    number.value = parse_double(name.substr(at, number.end - at)).value_or(0);
    number.has_fraction = name.substr(at, number.end - at).find('.') != std::string_view::npos;
    number.has_minus = at > 0 && name[at - 1] == '-' && (at < 2 || !is_digit(name[at - 2]));
    if (number.has_minus) {
      --number.begin;
      const char before = at < 2 ? '/' : lower(name.substr(at - 2, 1))[0];
      number.may_be_negative = before < 'a' || before > 'z';
    }
    at = number.end - 1;
    numbers.push_back(number);
  }
  return numbers;
}

using Order = std::vector<std::size_t>;
using NumberColumn = std::vector<NameNumber>;  // the numbers at one place of all names

// Those that differ between the names. Empty if the names differ in other parts, too.
std::vector<NumberColumn> varying_columns(const std::vector<std::string>& names) {
  std::vector<NumberColumn> columns;
  const std::string pattern = lower(name_pattern(names.front()));
  for (const std::string& name : names) {
    if (lower(name_pattern(name)) != pattern) return {};
    const std::vector<NameNumber> numbers = numbers_in(name);
    columns.resize(numbers.size());
    for (std::size_t at = 0; at < numbers.size(); ++at) columns[at].push_back(numbers[at]);
  }
  // Numbers behind each other or their minus signs make no difference to a pattern.
  std::erase_if(columns, [&](const NumberColumn& column) {
    return column.size() != names.size() ||
           std::ranges::all_of(column, [&](const NameNumber& number) {
             return number.value == column.front().value &&
                    number.has_minus == column.front().has_minus;
           });
  });
  return columns;
}

// With their signs: all may be negative, or only some have a minus.
std::vector<double> signed_values(const NumberColumn& column) {
  const auto minus = std::ranges::count_if(column, &NameNumber::has_minus);
  const bool all_may_be_negative = std::ranges::all_of(
      column, [](const NameNumber& number) { return !number.has_minus || number.may_be_negative; });
  const bool are_signs = minus > 0 && (minus < std::ssize(column) || all_may_be_negative);
  std::vector<double> values;
  for (const NameNumber& number : column) {
    values.push_back(number.has_minus && are_signs ? -number.value : number.value);
  }
  return values;
}

Order order_of(const std::vector<double>& values) {
  Order order(values.size());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, {}, [&](std::size_t at) { return values[at]; });
  return order;
}

// The first place in the order behind which the distance is larger than between others; 0 if all
// are about equal, as decimals are rounded.
std::size_t gap_in(const std::vector<double>& values, const Order& order) {
  constexpr double kRounding = 1.5;
  std::vector<double> steps;
  for (std::size_t at = 1; at < order.size(); ++at) {
    steps.push_back(values[order[at]] - values[order[at - 1]]);
  }
  const double least = *std::ranges::min_element(steps);
  const auto gap = std::ranges::find_if(steps, [&](double s) { return !(s < least * kRounding); });
  return gap == steps.end() ? 0 : static_cast<std::size_t>(gap - steps.begin()) + 1;
}

bool are_in_one_unit(const std::vector<double>& values) {
  return std::ranges::all_of(
      values, [&](double value) { return std::floor(value) == std::floor(values.front()); });
}

[[noreturn]] void throw_several_orders(const std::string& one, const std::string& other) {
  throw_unusable("The order of the images is not clear from the numbers in their names, as in " +
                 printable(one) + " and " + printable(other) +
                 ". Name them with one number that counts slices, and put the images of each "
                 "channel or time into a folder of their own.");
}

std::string missing_in(const std::vector<std::string>& names, const Order& order) {
  std::vector<std::string> sorted;
  for (const std::size_t at : order) sorted.push_back(names[at]);
  return missing_between(sorted);
}

void check_missing(const std::vector<std::string>& names, const Order& order) {
  const std::string missing = missing_in(names, order);
  if (missing.empty()) return;
  throw_unusable("An image is missing between the others: " + printable(missing) + ".");
}

[[noreturn]] void throw_gap(const std::string& before, const std::string& behind) {
  throw_unusable("An image is missing between " + printable(before) + " and " + printable(behind) +
                 ".");
}

// Names that differ in one number only. With a constant whole part, the digits behind a dot may
// also be a number of their own: "1.9" before "1.10". Even distances then tell which it is.
Order order_of_column(const std::vector<std::string>& names, const Order& natural,
                      const NumberColumn& column) {
  const std::vector<double> values = signed_values(column);
  const bool is_signed = std::ranges::any_of(values, [](double value) { return value < 0; });
  if (!is_signed && std::ranges::none_of(column, &NameNumber::has_fraction)) {
    check_missing(names, natural);
    return natural;
  }
  const Order order = order_of(values);
  const auto equal =
      std::ranges::adjacent_find(order, {}, [&](std::size_t at) { return values[at]; });
  if (equal != order.end()) {
    if (is_signed) throw_several_orders(names[*equal], names[*std::next(equal)]);
    check_missing(names, natural);
    return natural;
  }
  const std::size_t gap = gap_in(values, order);
  const bool may_be_whole = !is_signed && order != natural && are_in_one_unit(values);
  if (may_be_whole) {
    const bool is_even = missing_in(names, natural).empty();
    if (is_even == (gap == 0)) throw_several_orders(names[natural[0]], names[natural[1]]);
    return is_even ? natural : order;
  }
  if (gap > 0) throw_gap(names[order[gap - 1]], names[order[gap]]);
  return order;
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

std::string name_pattern(std::string_view name) {
  std::string pattern;
  std::size_t begin = 0;
  for (const NameNumber& number : numbers_in(name)) {
    pattern += std::string(name.substr(begin, number.begin - begin)) + '*';
    begin = number.end;
  }
  return pattern + std::string(name.substr(begin));
}

Order slice_order(const std::vector<std::string>& names) {
  Order natural(names.size());
  std::iota(natural.begin(), natural.end(), 0);
  std::ranges::stable_sort(natural, comes_before, [&](std::size_t at) { return lower(names[at]); });
  const std::vector<NumberColumn> columns = varying_columns(names);
  if (columns.size() == 1) return order_of_column(names, natural, columns.front());
  for (const NumberColumn& column : columns) {
    const std::vector<double> values = signed_values(column);
    for (std::size_t at = 1; at < natural.size(); ++at) {
      if (values[natural[at]] >= values[natural[at - 1]]) continue;
      throw_several_orders(names[natural[at - 1]], names[natural[at]]);
    }
  }
  check_missing(names, natural);
  return natural;
}

}  // namespace isomesh::import
