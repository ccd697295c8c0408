#include "proto/json_tree.h"

#include <limits>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/text.h"
#include "proto/json_text.h"
#include "proto/labels.h"

namespace isomesh {

std::string dump(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string valid_utf8(std::string_view text) {
  return parse_json<Json>(dump(Json(text))).get<std::string>();
}

bool is_json(std::string_view text) {
  return !parse_json<Json>(text, nullptr, false).is_discarded();
}

JsonTree::JsonTree() : root_(std::make_unique<Json>()) {}

JsonTree::JsonTree(std::string_view text)
    : root_(std::make_unique<Json>(parse_json<Json>(text, nullptr, false))) {
  if (root_->is_discarded()) throw Error(ErrorCode::kInternal, "is not JSON");
}

JsonTree::~JsonTree() = default;
JsonTree::JsonTree(JsonTree&&) noexcept = default;
JsonTree& JsonTree::operator=(JsonTree&&) noexcept = default;

namespace json_values {

void assign_null(Json& place) { place = nullptr; }
void assign(Json& place, bool value) { place = value; }
void assign(Json& place, std::int64_t value) {
  const bool is_exact = value >= -kMostExactNumber && value <= kMostExactNumber;
  place = is_exact ? Json(value) : Json(std::to_string(value));
}
void assign(Json& place, std::uint64_t value) { place = value; }
void assign(Json& place, double value) { place = value; }
void assign(Json& place, std::string_view value) { place = value; }
void make_object(Json& place) { place = Json::object(); }
void make_array(Json& place) { place = Json::array(); }
Json& member(Json& object, std::string_view name) { return object[std::string(name)]; }
Json& append(Json& array) { return array.emplace_back(nullptr); }

void throw_wrong_kind() { throw Error(ErrorCode::kInternal, "has a member of the wrong type"); }

bool is_null(const Json& json) { return json.is_null(); }
bool is_string(const Json& json) { return json.is_string(); }
bool is_number(const Json& json) { return json.is_number(); }
bool is_array(const Json& json) { return json.is_array(); }
bool is_object(const Json& json) { return json.is_object(); }

bool boolean(const Json& json) {
  if (!json.is_boolean()) throw_wrong_kind();
  return json.get<bool>();
}

std::int64_t whole(const Json& json, std::int64_t least, std::int64_t most) {
  using Limits = std::numeric_limits<std::int64_t>;
  if (json.is_string() && least == Limits::min() && most == Limits::max()) {
    const auto value = parse_int64(json.get_ref<const std::string&>());
    if (!value) throw_wrong_kind();
    return *value;
  }
  constexpr auto kMost = static_cast<std::uint64_t>(Limits::max());
  if (!json.is_number_integer()) throw_wrong_kind();
  if (json.is_number_unsigned() && json.get<std::uint64_t>() > kMost) throw_wrong_kind();
  const auto value = json.get<std::int64_t>();
  if (value < least || value > most) throw_wrong_kind();
  return value;
}

std::uint64_t whole(const Json& json, std::uint64_t most) {
  if (!json.is_number_unsigned() || json.get<std::uint64_t>() > most) throw_wrong_kind();
  return json.get<std::uint64_t>();
}

double number(const Json& json) {
  if (!json.is_number()) throw_wrong_kind();
  return json.get<double>();
}

std::string text(const Json& json) {
  if (!json.is_string()) throw_wrong_kind();
  return json.get<std::string>();
}

void check_object(const Json& json) {
  if (!json.is_object()) throw_wrong_kind();
}

std::size_t array_size(const Json& json) {
  if (!json.is_array()) throw_wrong_kind();
  return json.size();
}

const Json& element(const Json& array, std::size_t index) {
  if (index >= array_size(array)) throw_wrong_kind();
  return array[index];
}

const Json& existing(const Json& json, std::string_view name) {
  const Json* const found = find(json, name);
  if (found == nullptr) throw Error(ErrorCode::kInternal, "lacks " + std::string(name));
  return *found;
}

const Json* find(const Json& json, std::string_view name) {
  const auto found = json.find(std::string(name));
  return found == json.end() ? nullptr : &*found;
}

void for_each_member(const Json& object,
                     const std::function<void(const std::string&, const Json&)>& use) {
  check_object(object);
  for (const auto& [name, value] : object.items()) use(name, value);
}

void fill(Json& record, const Json& defaults) {
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

}  // namespace json_values
}  // namespace isomesh
