// JSON <-> types of which `visit` tells the fields, for the sources of this folder alone.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/text.h"
#include "proto/fields.h"

namespace isomesh::json_values {

template <class T>
constexpr bool kIsPerFormat = false;
template <class T>
constexpr bool kIsPerFormat<std::map<MeshFormat, T>> = true;
template <class T>
constexpr bool kIsPerLabel = std::is_same_v<T, LabelTexts> || std::is_same_v<T, LabelValues>;

// --- Writing -------------------------------------------------------------------------------------

template <class T>
Json write(const T& value);

template <class T>
Json write_optional(const std::optional<T>& value) {
  return value ? write(*value) : Json(nullptr);
}

template <class T>
void write_field(Json& object, const char* name, const T& value) {
  object[name] = write(value);
}

template <class T>
void write_field(Json& object, const char* name, const std::optional<T>& value) {
  object[name] = write_optional(value);
}

template <class T>
void write_field(Json& object, const Parameter& parameter, const std::optional<T>& value) {
  const bool has_word = !value && parameter.when_empty != nullptr;
  object[parameter.name] = has_word ? Json(parameter.when_empty) : write_optional(value);
}

template <class T>
Json write(const T& value) {
  if constexpr (std::is_same_v<T, Scheme>) {
    return static_cast<int>(value);
  } else if constexpr (Enumeration<T>) {
    return std::string(to_string(value));
  } else if constexpr (kIsPerFormat<T>) {
    Json object = Json::object();
    for (const auto& [format, file] : value) object[std::string(to_string(format))] = write(file);
    return object;
  } else if constexpr (kIsPerLabel<T>) {
    Json object = Json::object();
    for (const auto& [label, text] : value) object[std::to_string(label)] = write(text);
    return object;
  } else if constexpr (std::is_same_v<T, LabelChoice>) {
    return value.is_all() ? Json(kAllLabels) : write(value.values);
  } else if constexpr (std::is_arithmetic_v<T> || std::is_same_v<T, std::string>) {
    return Json(value);
  } else if constexpr (requires { value.begin(); }) {
    Json array = Json::array();
    for (const auto& element : value) array.push_back(write(element));
    return array;
  } else {
    Json object = Json::object();
    visit(value, [&](const auto& name, const auto& member) { write_field(object, name, member); });
    return object;
  }
}

template <class T>
std::string to_text(const T& value) {
  // A volume's name or a message may hold bytes that are not UTF-8: replaced, never thrown on.
  return write(value).dump(-1, ' ', false, Json::error_handler_t::replace);
}

inline std::string page(const char* name, Json items, const std::string& next) {
  return Json{{name, std::move(items)}, {"next", next.empty() ? Json(nullptr) : Json(next)}}.dump(
      -1, ' ', false, Json::error_handler_t::replace);
}

// --- Reading answers -----------------------------------------------------------------------------

template <class T>
void read(const Json& json, T& value);

template <class T>
constexpr bool kIsOptional = false;
template <class T>
constexpr bool kIsOptional<std::optional<T>> = true;

// Throws as nlohmann's own readers do, where those would take another kind for an empty one.
inline void check_kind(bool right) {
  if (!right)
    throw Error(ErrorCode::kInternal, "the server's response has a member of the wrong type");
}

inline bool may_be_absent(const char* /*name*/) { return false; }
inline bool may_be_absent(const Parameter& parameter) { return parameter.may_be_absent; }

// What a label is called as a member's name.
inline std::int64_t label_from(const std::string& text) {
  const auto label = parse_int64(text);
  check_kind(label.has_value());
  return *label;
}

template <class T>
void read_field(const Json& json, std::optional<T>& value) {
  if (json.is_null() || (json.is_string() && std::is_same_v<T, double>)) {
    value.reset();
    return;
  }
  read(json, value.emplace());
}

template <class T>
void read_field(const Json& json, T& value) {
  read(json, value);
}

template <class T>
void read(const Json& json, T& value) {
  if constexpr (std::is_same_v<T, Scheme>) {
    value = json.get<int>() == 5 ? Scheme::kFive : Scheme::kSix;
  } else if constexpr (Enumeration<T>) {
    const auto known = from_string<T>(json.get<std::string>());
    if (!known) throw Error(ErrorCode::kInternal, "the server's response has an unknown value");
    value = *known;
  } else if constexpr (kIsPerFormat<T>) {
    check_kind(json.is_object());
    for (const auto& [name, file] : json.items()) {
      if (const auto format = from_string<MeshFormat>(name)) read(file, value[*format]);
    }
  } else if constexpr (kIsPerLabel<T>) {
    check_kind(json.is_object());
    for (const auto& [name, text] : json.items()) read(text, value[label_from(name)]);
  } else if constexpr (std::is_same_v<T, LabelChoice>) {
    if (json != kAllLabels) read(json, value.values);
  } else if constexpr (std::is_arithmetic_v<T> || std::is_same_v<T, std::string>) {
    value = json.get<T>();
  } else if constexpr (requires { value.emplace_back(); }) {
    check_kind(json.is_array());
    value.clear();
    for (const auto& element : json) read(element, value.emplace_back());
  } else if constexpr (requires { value.begin(); }) {
    for (std::size_t i = 0; i < value.size(); ++i) read(json.at(i), value[i]);
  } else {
    check_kind(json.is_object());
    visit(value, [&](const auto& name, auto& member) {
      // RFC 9457 requires no member of a problem; lists of other things came after the first
      // version, or are left out where they are empty.
      using Member = std::remove_reference_t<decltype(member)>;
      constexpr bool kMayHaveNoList = std::is_same_v<T, Volume> || std::is_same_v<T, MeshSummary> ||
                                      std::is_same_v<T, Estimate> ||
                                      std::is_same_v<T, DicomIdentity>;
      constexpr bool kMayBeMissing = std::is_same_v<T, Problem> || kIsOptional<Member> ||
                                     (kMayHaveNoList && !std::is_same_v<Member, std::string> &&
                                      requires { member.emplace_back(); });
      const char* const key = name;
      if (const auto found = json.find(key); found != json.end()) {
        read_field(*found, member);
      } else if (!kMayBeMissing && !may_be_absent(name)) {
        throw Error(ErrorCode::kInternal, std::string("the server's response lacks ") + key);
      }
    });
  }
}

template <class T>
T from_text(std::string_view text, const char* list = nullptr) {
  try {
    const Json json = Json::parse(text);
    T value{};
    read(list ? json.at(list) : json, value);
    return value;
  } catch (const Json::exception&) {
    throw Error(ErrorCode::kInternal, "the server's response does not match the API");
  }
}

// Adds the members that `defaults` has and `record` lacks, at every depth.
inline void fill(Json& record, const Json& defaults) {
  if (!record.is_object() || !defaults.is_object()) return;
  for (const auto& [name, value] : defaults.items()) {
    const auto found = record.find(name);
    if (found == record.end()) {
      record[name] = value;
    } else {
      fill(*found, value);
    }
  }
}

template <class T>
T from_record(std::string_view text) {
  try {
    Json json = Json::parse(text);
    static const Json defaults = write(T{});
    fill(json, defaults);
    if constexpr (std::is_same_v<T, Job>) {
      static const Json mesh_defaults = write(MeshSummary{});
      fill(json["mesh"], mesh_defaults);
    }
    if constexpr (std::is_same_v<T, Volume>) {
      if (json.contains("dicom")) fill(json["dicom"], write(DicomIdentity{}));
    }
    T value{};
    read(json, value);
    return value;
  } catch (const Json::exception&) {
    throw Error(ErrorCode::kInternal, "a record was not written by a version of this service");
  }
}

}  // namespace isomesh::json_values
