// Reads the members of a request by the rows of `visit`, such as the table of parameters. Private
// to this folder.
#pragma once

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <concepts>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/text.h"
#include "proto/fields.h"
#include "proto/json.h"
#include "proto/json_tree.h"

namespace isomesh {

// Types that are objects in a request: their `visit` has rows.
template <class T>
constexpr bool kIsRequestObject = ParameterGroup<T> || std::is_same_v<T, Callback>;

// Collects the errors of all members, so that one response names them all.
class RequestReader {
 public:
  // Sets how errors spell a member's path. The default is the path itself.
  using Spelling = std::string (*)(const std::string& path);
  void spell_by(Spelling spelling) { spelling_ = spelling; }

  // Reads `json` into `value` by the rows of `visit`. Rejects any other member.
  template <class T>
  void read_object(const Json& json, T& value, const std::string& prefix) {
    std::vector<std::string> known;
    visit(value, [&](const Parameter& parameter, auto& member) {
      known.emplace_back(parameter.name);
      if (const auto found = json.find(parameter.name); found != json.end()) {
        read_member(*found, prefix + parameter.name, parameter, member);
      }
    });
    for (const auto& [name, unused] : json.items()) {
      if (std::ranges::find(known, name) == known.end()) {
        add(prefix + name, "is not a known member");
      }
    }
  }

  // As read_object, for a whole object: required members must be present.
  template <class T>
  void read_whole_object(const Json& json, T& value, const std::string& prefix) {
    read_object(json, value, prefix);
    visit(value, [&](const Parameter& parameter, const auto& /*member*/) {
      if (parameter.is_required && !json.contains(parameter.name)) {
        add(prefix + parameter.name, "is required");
      }
    });
  }

  void add(const std::string& field, const std::string& message) {
    if (errors_.size() >= kMostErrors) return;
    const std::string name = field.substr(0, kLongestName);
    errors_.push_back({spelling_ == nullptr ? name : spelling_(name), message});
  }

  void throw_if_any() {
    if (!errors_.empty()) throw invalid_parameters(std::move(errors_));
  }

 private:
  static constexpr std::size_t kMostErrors = 20;
  static constexpr std::size_t kLongestName = 64;

  static bool fits(const Parameter& parameter, double number) {
    return std::isfinite(number) && !(parameter.minimum && number < *parameter.minimum) &&
           !(parameter.above && number <= *parameter.above) &&
           !(parameter.maximum && number > *parameter.maximum);
  }

  // Exact up to 64 bits. Numbers that are strings in responses may be strings here, too.
  static std::optional<std::int64_t> long_number(const Json& json) {
    if (json.is_string()) {
      const auto number = parse_int64(json.get<std::string>());
      const bool is_long = number && (*number < -kMostExactNumber || *number > kMostExactNumber);
      return is_long ? number : std::nullopt;
    }
    if (json.is_number_float()) {
      const double number = json.get<double>();
      const bool is_whole =
          std::floor(number) == number && std::abs(number) <= static_cast<double>(kMostExactNumber);
      return is_whole ? std::optional(static_cast<std::int64_t>(number)) : std::nullopt;
    }
    const bool is_too_large =
        json.is_number_unsigned() && !std::in_range<std::int64_t>(json.get<std::uint64_t>());
    if (!json.is_number_integer() || is_too_large) return std::nullopt;
    return json.get<std::int64_t>();
  }

  // Reads 1 to `most` values; `kind` says in words what they are.
  template <class T>
  void read_list(const Json& json, const std::string& path, const Parameter& parameter,
                 std::size_t most, const std::string& kind, std::vector<T>& values) {
    if (!json.is_array() || json.empty() || json.size() > most) {
      return add(path, "must be a list of 1 to " + std::to_string(most) + ' ' + kind);
    }
    values.clear();
    for (const Json& element : json) {
      const std::size_t before = errors_.size();
      read_member(element, path, parameter, values.emplace_back());
      if (errors_.size() > before) return values.clear();
    }
  }

  void read_member(const Json& json, const std::string& path, const Parameter& /*parameter*/,
                   std::string& value) {
    if (!json.is_string()) return add(path, "must be a string");
    value = json.get<std::string>();
  }

  template <class Number>
  requires std::is_arithmetic_v<Number>
  void read_member(const Json& json, const std::string& path, const Parameter& parameter,
                   std::optional<Number>& value) {
    const Json empty = parameter.when_empty == nullptr ? Json(nullptr) : Json(parameter.when_empty);
    if (json == empty) return value.reset();
    read_member(json, path, parameter, value.emplace());
  }

  // Numbers are names without quotes; one with a point is the same number.
  void read_member(const Json& json, const std::string& path, const Parameter& /*parameter*/,
                   SchemeName& value) {
    std::string name = json.is_string() ? json.get<std::string>() : json.dump();
    if (json.is_number() && name.ends_with(".0")) name.resize(name.size() - 2);
    const auto known = from_string<SchemeName>(name);
    if (!known || is_digits(name) == json.is_string()) {
      return add(path, "must be " + names_of<SchemeName>());
    }
    value = *known;
  }

  void read_member(const Json& json, const std::string& path, const Parameter& /*parameter*/,
                   Enumeration auto& value) {
    using Enum = std::remove_reference_t<decltype(value)>;
    const auto known = json.is_string() ? from_string<Enum>(json.get<std::string>()) : std::nullopt;
    if (!known) return add(path, "must be " + names_of<Enum>());
    value = *known;
  }

  void read_member(const Json& json, const std::string& path, const Parameter& parameter,
                   std::integral auto& value) {
    using Number = std::remove_reference_t<decltype(value)>;
    if constexpr (std::is_same_v<Number, std::int64_t>) {
      const auto whole = long_number(json);
      if (!whole || !fits(parameter, static_cast<double>(*whole))) {
        return add(path, must_be(parameter, true));
      }
      value = *whole;
      return;
    }
    const double number = json.is_number() ? json.get<double>() : std::nan("");
    if (std::floor(number) != number || !fits(parameter, number)) {
      return add(path, must_be(parameter, true));
    }
    value = static_cast<std::remove_reference_t<decltype(value)>>(number);
  }

  void read_member(const Json& json, const std::string& path, const Parameter& parameter,
                   double& value) {
    const double number = json.is_number() ? json.get<double>() : std::nan("");
    if (!fits(parameter, number)) return add(path, must_be(parameter, false));
    value = number;
  }

  void read_member(const Json& json, const std::string& path, const Parameter& /*parameter*/,
                   bool& value) {
    if (!json.is_boolean()) return add(path, "must be true or false");
    value = json.get<bool>();
  }

  void read_member(const Json& json, const std::string& path, const Parameter& parameter,
                   std::vector<MeshFormat>& formats) {
    if (!json.is_array() || json.empty()) {
      return add(path, "must be a list of at least one of " + names_of<MeshFormat>());
    }
    formats.clear();
    for (const Json& element : json) {
      MeshFormat format{};
      const std::size_t before = errors_.size();
      read_member(element, path, parameter, format);
      if (errors_.size() > before) return;
      if (std::ranges::find(formats, format) == formats.end()) formats.push_back(format);
    }
  }

  // Sorts the values and removes repeated ones.
  void read_member(const Json& json, const std::string& path, const Parameter& parameter,
                   std::vector<std::int64_t>& values) {
    read_list(json, path, parameter, Volume::kMostLabels, "whole numbers", values);
    std::ranges::sort(values);
    values.erase(std::unique(values.begin(), values.end()), values.end());
  }

  void read_member(const Json& json, const std::string& path, const Parameter& parameter,
                   std::vector<double>& values) {
    read_list(json, path, parameter, MeshParameters::kMostLods, "numbers", values);
  }

  void read_member(const Json& json, const std::string& path, const Parameter& /*parameter*/,
                   std::array<double, 3>& place) {
    const auto is_number = [](const Json& one) {
      return one.is_number() && std::isfinite(one.get<double>());
    };
    if (!json.is_array() || json.size() != place.size() || !std::ranges::all_of(json, is_number)) {
      return add(path, "must be three finite numbers per point: x, y and z");
    }
    for (std::size_t axis = 0; axis < place.size(); ++axis) place[axis] = json[axis];
  }

  void read_member(const Json& json, const std::string& path, const Parameter& parameter,
                   std::vector<std::array<double, 3>>& places) {
    read_list(json, path, parameter, ComponentFilter::kMostPlaces, "points", places);
  }

  void read_member(const Json& json, const std::string& path, const Parameter& parameter,
                   std::optional<Box>& box) {
    if (json.is_null()) return box.reset();
    if (!json.is_array() || json.size() != 2) {
      return add(path, "must be two corners, each of three numbers: x, y and z");
    }
    const std::size_t before = errors_.size();
    box.emplace();
    for (std::size_t n = 0; n < 2 && errors_.size() == before; ++n) {
      read_member(json[n], path, parameter, (*box)[n]);
    }
    if (errors_.size() > before) return;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if ((*box)[0][axis] >= (*box)[1][axis]) {
        return add(path, "must have a first corner that is smaller than the second in x, y and z");
      }
    }
  }

  void read_member(const Json& json, const std::string& path, const Parameter& parameter,
                   std::optional<LabelChoice>& value) {
    value.emplace();
    if (json == kAllLabels) return;
    if (!json.is_array()) {
      return add(path, "must be \"all\" or a list of whole numbers");
    }
    read_member(json, path, parameter, value->values);
  }

  // Reads an object whose member names are labels.
  template <class T>
  void read_member(const Json& json, const std::string& path, const Parameter& parameter,
                   std::map<std::int64_t, T>& value) {
    if (!json.is_object() || json.size() > Volume::kMostLabels) {
      return add(path, "must be an object with at most " + std::to_string(Volume::kMostLabels) +
                           " members named by labels");
    }
    for (const auto& [name, element] : json.items()) {
      const auto label = parse_int64(name);
      std::int64_t key = 0;
      const std::size_t before = errors_.size();
      const std::string place = path + '.' + name;
      read_member(label ? Json(*label) : Json(), place, rows::kLabelName, key);
      if (errors_.size() == before && value.contains(key)) {
        add(place, "names a label that another member names, too");
      }
      if (errors_.size() == before) read_of_label(element, place, parameter, value[key]);
      if (errors_.size() > before) return;
    }
  }

  void read_of_label(const Json& json, const std::string& path, const Parameter& parameter,
                     std::vector<std::int64_t>& values) {
    read_member(json, path, parameter, values);
  }

  void read_of_label(const Json& json, const std::string& path, const Parameter& parameter,
                     std::string& value) {
    if (!json.is_string()) return add(path, "must be a string");
    read_member(json, path, parameter, value);
    if (parameter.text == TextKind::kColor) {
      std::ranges::transform(value, value.begin(), [](unsigned char c) { return std::tolower(c); });
      if (!is_color(value)) add(path, "must be a colour such as \"#d8654f\"");
    } else if (trimmed(value).empty() || value.size() > LabelEntry::kMostNameBytes ||
               has_control_characters(value)) {
      add(path, "must be a text of 1 to 255 bytes on one line");
    }
  }

  template <class T>
  requires kIsRequestObject<T>
  void read_member(const Json& json, const std::string& path, const Parameter& /*parameter*/,
                   T& value) {
    if (!json.is_object()) return add(path, "must be an object");
    read_whole_object(json, value, path + ".");
  }

  template <class T>
  requires kIsRequestObject<T>
  void read_member(const Json& json, const std::string& path, const Parameter& parameter,
                   std::vector<T>& values) {
    if (!json.is_array()) return add(path, "must be a list of objects");
    for (const Json& element : json) read_member(element, path, parameter, values.emplace_back());
  }

  // Null is allowed for optional members.
  template <class T>
  requires(!std::is_arithmetic_v<T>) void read_member(const Json& json, const std::string& path,
                                                      const Parameter& parameter,
                                                      std::optional<T>& value) {
    if (json.is_null() && parameter.may_be_absent) return value.reset();
    read_member(json, path, parameter, value.emplace());
  }

  Spelling spelling_ = nullptr;
  std::vector<FieldError> errors_;
};

// Parses a request's body. Adds an error for each duplicate member, because JSON parsers differ in
// which one they use. Throws Error kInvalidParameter if the body is not one JSON object.
Json request_body(std::string_view body, RequestReader& reader);

}  // namespace isomesh
