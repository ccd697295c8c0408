#include "server/import/images/natural_order.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <system_error>

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
  bool may_be_negative = false;    // the minus does not separate the number from a letter
  double value = 0;                // without the minus
  std::string_view fraction = {};  // the digits behind the dot
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
    const std::string_view digits = name.substr(at, number.end - at);
    number.value = parse_double(digits).value_or(0);
    number.fraction = digits.substr(std::min(digits.find('.'), digits.size() - 1) + 1);
    number.has_minus = at > 0 && name[at - 1] == '-' && (at < 2 || !is_digit(name[at - 2]));
    if (number.has_minus) {
      --number.begin;
      const char before = at < 2 ? '_' : lower(name.substr(at - 2, 1))[0];
      number.may_be_negative = static_cast<unsigned char>(before) < 'a';  // letters of any script
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

bool has_fraction(const NameNumber& number) { return !number.fraction.empty(); }

// A minus is a sign beside numbers without one. In front of all numbers it separates, as in "s-1".
std::vector<double> signed_values(const NumberColumn& column) {
  const bool are_signs = !std::ranges::all_of(column, &NameNumber::has_minus);
  std::vector<double> values;
  for (const NameNumber& number : column) {
    values.push_back(number.has_minus && are_signs ? -number.value : number.value);
  }
  return values;
}

// Equal ones stay in their natural order.
template <typename Value>
Order order_of(const std::vector<Value>& values, Order natural) {
  std::ranges::stable_sort(natural, {}, [&](std::size_t at) { return values[at]; });
  return natural;
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

// The positions of slices may lie anywhere, whole numbers count them.
void check_signed(const std::vector<std::string>& names, const NumberColumn& column,
                  const std::vector<double>& values, const Order& order) {
  const auto equal =
      std::ranges::adjacent_find(order, {}, [&](std::size_t at) { return values[at]; });
  if (equal != order.end()) throw_several_orders(names[*equal], names[*std::next(equal)]);
  if (std::ranges::any_of(column, has_fraction)) return;
  const std::size_t gap = gap_in(values, order);
  if (gap == 0) return;
  throw_unusable("An image is missing between " + printable(names[order[gap - 1]]) + " and " +
                 printable(names[order[gap]]) + ".");
}

// Decimals of several lengths do not end in zeros, as "1.10" beside "1.9".
bool has_long_zero(const NumberColumn& column) {
  const auto size = [](const NameNumber& number) { return number.fraction.size(); };
  const std::size_t least = size(*std::ranges::min_element(column, {}, size));
  return std::ranges::any_of(column, [&](const NameNumber& number) {
    return size(number) > std::max<std::size_t>(least, 1) && number.fraction.back() == '0';
  });
}

// True if the digits behind a dot are a number of their own, with another order than decimals have:
// "1.9" before "1.10". Even distances tell which it is.
bool counts_behind_dot(const std::vector<std::string>& names, const NumberColumn& column,
                       const Order& natural, const Order& order) {
  if (has_long_zero(column)) return true;
  const std::vector<double> values = signed_values(column);
  const bool counts = are_in_one_unit(values) && missing_in(names, natural).empty();
  const bool is_decimal = gap_in(values, order) == 0;
  if (counts == is_decimal) {
    const auto [one, other] = std::ranges::mismatch(natural, order);
    throw_several_orders(names[*one], names[*other]);
  }
  return counts;
}

// Names that are in the order of one number.
Order order_of_column(const std::vector<std::string>& names, const Order& natural,
                      const NumberColumn& column) {
  const std::vector<double> values = signed_values(column);
  const Order order = order_of(values, natural);
  if (std::ranges::any_of(values, [](double value) { return value < 0; })) {
    check_signed(names, column, values, order);
    return order;
  }
  if (std::ranges::any_of(column, has_fraction)) {
    if (std::ranges::all_of(column, &NameNumber::may_be_negative)) {
      throw_several_orders(names[natural[0]], names[natural[1]]);
    }
    if (order != natural && !counts_behind_dot(names, column, natural, order)) return order;
  }
  check_missing(names, natural);
  return natural;
}

// Each value of the first number comes with the same others, as channels with slices.
bool form_grid(const std::vector<std::vector<double>>& rows) {
  std::map<double, std::set<std::vector<double>>> others;
  for (const std::vector<double>& row : rows) others[row[0]].insert({row.begin() + 1, row.end()});
  const auto& first = others.begin()->second;
  return first.size() > 1 &&
         std::ranges::all_of(others, [&](const auto& each) { return each.second == first; });
}

// Names of several numbers, the first of which repeats values.
Order order_of_rows(const std::vector<std::string>& names, const Order& natural,
                    const std::vector<NumberColumn>& columns) {
  std::vector<std::vector<double>> rows(names.size());
  for (const NumberColumn& column : columns) {
    const std::vector<double> values = signed_values(column);
    for (std::size_t at = 0; at < rows.size(); ++at) rows[at].push_back(values[at]);
  }
  const bool is_grid = form_grid(rows);
  const Order order =
      is_grid ? order_of(signed_values(columns[1]), natural) : order_of(rows, natural);
  const auto [one, other] = std::ranges::mismatch(natural, order);
  if (one != natural.end()) throw_several_orders(names[*one], names[*other]);
  return natural;
}

bool are_distinct(const NumberColumn& column) {
  const std::vector<double> values = signed_values(column);
  return std::set<double>(values.begin(), values.end()).size() == values.size();
}

// A name in small letters, without the suffix of an image.
std::string stem_of(std::string_view name) {
  std::string stem = lower(name);
  for (const std::string_view suffix :
       {".gz", ".tif", ".tiff", ".btf", ".tf8", ".lsm", ".png", ".bmp"}) {
    if (stem.ends_with(suffix)) stem.resize(stem.size() - suffix.size());
  }
  return stem;
}

std::vector<std::string> stems_of(const std::vector<std::string>& names) {
  std::vector<std::string> stems;
  for (const std::string& name : names) stems.push_back(stem_of(name));
  return stems;
}

// True if the names differ in hexadecimal numbers of one length, of which none is missing.
bool are_hexadecimal(std::vector<std::string> stems) {
  std::ranges::sort(stems);
  const std::string& first = stems.front();
  std::size_t begin = first.size();
  std::size_t end = 0;
  for (const std::string& stem : stems) {
    if (stem.size() != first.size()) return false;
    for (std::size_t at = 0; at < first.size(); ++at) {
      if (stem[at] == first[at]) continue;
      begin = std::min(begin, at);
      end = std::max(end, at + 1);
    }
  }
  if (begin >= end) return false;
  std::vector<std::uint64_t> numbers;
  bool has_letters = false;
  for (const std::string& stem : stems) {
    std::uint64_t number = 0;
    const char* last = stem.data() + end;
    const auto [stop, error] = std::from_chars(stem.data() + begin, last, number, 16);
    if (error != std::errc() || stop != last) return false;
    has_letters = has_letters || !std::all_of(stem.data() + begin, last, is_digit);
    numbers.push_back(number);
  }
  for (std::size_t at = 1; at < numbers.size(); ++at) {
    if (numbers[at] - numbers[at - 1] != numbers[1] - numbers[0]) return false;
  }
  return has_letters;
}

// The values of the first number that differs.
std::set<double> numbers_of(const std::vector<std::string>& stems, const Order& group) {
  std::vector<std::string> names;
  for (const std::size_t at : group) names.push_back(stems[at]);
  const std::vector<NumberColumn> columns = varying_columns(names);
  if (columns.empty()) return {};
  const std::vector<double> values = signed_values(columns.front());
  return {values.begin(), values.end()};
}

bool share_numbers(const std::vector<std::string>& stems, const Order& one, const Order& other) {
  const std::set<double> numbers = numbers_of(stems, other);
  return std::ranges::any_of(numbers_of(stems, one),
                             [&](double number) { return numbers.contains(number); });
}

// True for the pattern of a name that lacks the number of the slices, and is not their first, as
// "s" may be beside "s_2".
bool is_beside(const std::string& pattern, const std::string& slices) {
  return std::ranges::count(pattern, '*') < std::ranges::count(slices, '*') &&
         !slices.starts_with(pattern);
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
  const std::vector<std::string> stems = stems_of(names);
  Order natural(names.size());
  std::iota(natural.begin(), natural.end(), 0);
  if (are_hexadecimal(stems)) return order_of(stems, natural);
  std::ranges::stable_sort(natural, comes_before, [&](std::size_t at) { return stems[at]; });
  const std::vector<NumberColumn> columns = varying_columns(stems);
  if (columns.empty()) {
    check_missing(names, natural);
    return natural;
  }
  return columns.size() == 1 || are_distinct(columns.front())
             ? order_of_column(names, natural, columns.front())
             : order_of_rows(names, natural, columns);
}

NameGroups groups_of(const std::vector<std::string>& names) {
  NameGroups all;
  all.volumes.emplace_back(names.size());
  std::iota(all.volumes[0].begin(), all.volumes[0].end(), 0);
  const std::vector<std::string> stems = stems_of(names);
  if (are_hexadecimal(stems)) return all;
  std::map<std::string, Order> by_pattern;
  for (std::size_t at = 0; at < stems.size(); ++at) {
    by_pattern[name_pattern(stems[at])].push_back(at);
  }
  const auto& [largest, most] = *std::ranges::max_element(
      by_pattern, {}, [](const auto& named) { return named.second.size(); });
  NameGroups groups;
  for (const auto& [pattern, group] : by_pattern) {
    if (group.size() > 1) {
      if (pattern != largest && !share_numbers(stems, group, most)) return all;
      groups.volumes.push_back(group);
    } else {
      if (!is_beside(pattern, largest)) return all;
      groups.others.push_back(group[0]);
    }
  }
  constexpr std::size_t kLeastNumbered = 3;  // for each other
  const std::size_t numbered = names.size() - groups.others.size();
  return groups.others.size() * kLeastNumbered > numbered ? all : groups;
}

}  // namespace isomesh::import
