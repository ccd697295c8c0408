// Options with values, and parsers of these values; private to this folder.
#pragma once

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "proto/types.h"

namespace isomesh::cli {

[[noreturn]] inline void refuse(const std::string& option, const std::string& message) {
  throw CLI::ValidationError(option, message);
}

template <class Number>
std::optional<Number> number_from(std::string_view text) {
  Number number{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  if constexpr (std::is_floating_point_v<Number>) {
    if (!std::isfinite(number)) return std::nullopt;
  }
  return number;
}

// Exactly N numbers, separated by commas.
template <class Number, std::size_t N>
std::optional<std::array<Number, N>> all_numbers_from(std::string_view text) {
  std::array<Number, N> numbers{};
  for (std::size_t n = 0; n < N; ++n) {
    const std::size_t end = std::min(text.find(','), text.size());
    const auto number = number_from<Number>(text.substr(0, end));
    const bool last = n + 1 == N;
    if (!number || last != (end == text.size())) return std::nullopt;
    numbers[n] = *number;
    text.remove_prefix(last ? end : end + 1);
  }
  return numbers;
}

template <class Number, std::size_t N>
std::array<Number, N> numbers_from(const std::string& option, std::string_view text) {
  const auto numbers = all_numbers_from<Number, N>(text);
  if (!numbers) refuse(option, "must be " + std::to_string(N) + " numbers separated by commas");
  return *numbers;
}

// "must be a whole number from 0 to 4294967295": the requirement of the type, for a rejected
// number.
template <class Number>
std::string must_be_number() {
  if constexpr (std::is_floating_point_v<Number>) return "must be a number";
  if constexpr (sizeof(Number) > 4) return "must be a whole number";
  return "must be a whole number from " + std::to_string(std::numeric_limits<Number>::min()) +
         " to " + std::to_string(std::numeric_limits<Number>::max());
}

template <class Enum>
Enum name_from(const std::string& option, const std::string& text) {
  const auto value = from_string<Enum>(text);
  if (!value) refuse(option, "must be " + names_of<Enum>());
  return *value;
}

// `--option VALUE` that calls `take(VALUE)`.
inline CLI::Option* add(CLI::App& app, const std::string& name, const std::string& value,
                        const std::string& help,
                        const std::function<void(const std::string&)>& take) {
  return app.add_option_function<std::string>(name, take, help)->type_name(value);
}

// The same for an option that may be repeated: `take` gets all of its values.
inline CLI::Option* add_repeated(CLI::App& app, const std::string& name, const std::string& value,
                                 const std::string& help,
                                 const std::function<void(const std::vector<std::string>&)>& take) {
  return app.add_option_function<std::vector<std::string>>(name, take, help + ". May be repeated")
      ->type_name(value)
      ->expected(1)
      ->allow_extra_args(false)  // `-o OUT A B`: A and B are inputs
      ->take_all();
}

template <class Number>
CLI::Option* add_number(CLI::App& app, const std::string& name, const std::string& help,
                        std::function<void(Number)> take,
                        const std::string& must_be = must_be_number<Number>()) {
  return add(app, name, "N", help,
             [name, must_be, take = std::move(take)](const std::string& text) {
               const auto number = number_from<Number>(text);
               if (!number) refuse(name, must_be);
               take(*number);
             });
}

// "linear|midpoint": the type that help shows and that completions offer.
template <class Enum>
std::string type_of_names() {
  std::string type;
  for (const std::string& name : name_list<Enum>()) type += (type.empty() ? "" : "|") + name;
  return type;
}

template <class Enum>
CLI::Option* add_name(CLI::App& app, const std::string& name, const std::string& help,
                      std::function<void(Enum)> take) {
  return add(app, name, type_of_names<Enum>(), help,
             [name, take = std::move(take)](const std::string& text) {
               take(name_from<Enum>(name, text));
             });
}

}  // namespace isomesh::cli
