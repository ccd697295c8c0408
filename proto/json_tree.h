// JSON values behind an interface without nlohmann's templates, which are slow to compile:
// json_tree.cpp instantiates them once. json_values.h uses these functions.
//
// The readers throw Error kInternal for a value of another kind. Its text lacks the subject ("has a
// member of the wrong type"), which the caller adds.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

namespace isomesh {

using Json = nlohmann::ordered_json;

// Writes one line. Replaces bytes that are not UTF-8, such as in a volume's name.
std::string dump(const Json& json);

// Replaces bytes that are not UTF-8 by U+FFFD.
std::string valid_utf8(std::string_view text);

bool is_json(std::string_view text);

// Owns a value and everything below it; initially null.
class JsonTree {
 public:
  JsonTree();
  // Throws Error kInternal if the text is not JSON.
  explicit JsonTree(std::string_view text);
  ~JsonTree();
  JsonTree(JsonTree&&) noexcept;
  JsonTree& operator=(JsonTree&&) noexcept;

  Json& root() { return *root_; }
  const Json& root() const { return *root_; }

 private:
  std::unique_ptr<Json> root_;
};

namespace json_values {

void assign_null(Json& place);
void assign(Json& place, bool value);
void assign(Json& place, std::int64_t value);
void assign(Json& place, std::uint64_t value);
void assign(Json& place, double value);
void assign(Json& place, std::string_view value);
void make_object(Json& place);
void make_array(Json& place);
// Returns the member of that name; adds it as null if it is new.
Json& member(Json& object, std::string_view name);
Json& append(Json& array);

bool is_null(const Json& json);
bool is_string(const Json& json);
bool is_number(const Json& json);
bool is_array(const Json& json);
bool is_object(const Json& json);
bool boolean(const Json& json);
// Reads a whole number. Throws if it is out of range.
std::int64_t whole(const Json& json, std::int64_t least, std::int64_t most);
std::uint64_t whole(const Json& json, std::uint64_t most);
double number(const Json& json);
std::string text(const Json& json);
void check_object(const Json& json);
std::size_t array_size(const Json& json);
const Json& element(const Json& array, std::size_t index);
// Throws if there is no such member.
const Json& existing(const Json& json, std::string_view name);
// Returns null if there is no such member or `json` is not an object.
const Json* find(const Json& json, std::string_view name);
void for_each_member(const Json& object,
                     const std::function<void(const std::string& name, const Json& value)>& use);
[[noreturn]] void throw_wrong_kind();

// Adds the members of `defaults` that `record` lacks, at every depth.
void fill(Json& record, const Json& defaults);

}  // namespace json_values
}  // namespace isomesh
