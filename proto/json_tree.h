// JSON values for those who do not want to compile nlohmann's templates: they are instantiated
// once, in json_tree.cpp. What json_values.h makes of types goes through these functions.
//
// The readers throw Error kInternal for a value of another kind; its text lacks the subject ("has a
// member of the wrong type"), which is for the caller to add.
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

// On one line. Bytes that are not UTF-8, such as in a volume's name, are replaced.
std::string dump(const Json& json);

// A value and everything below it; null at first.
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
// The member of that name, which is null if it is new.
Json& member(Json& object, std::string_view name);
// A new element, null at first, at the array's end.
Json& append(Json& array);

bool is_null(const Json& json);
bool is_string(const Json& json);
bool boolean(const Json& json);
// A whole number, which fits into the range.
std::int64_t whole(const Json& json, std::int64_t least, std::int64_t most);
std::uint64_t whole(const Json& json, std::uint64_t most);
double number(const Json& json);
std::string text(const Json& json);
void check_object(const Json& json);
std::size_t array_size(const Json& json);
const Json& element(const Json& array, std::size_t index);
// Null if there is none, or `json` is no object.
const Json* find(const Json& json, std::string_view name);
void for_each_member(const Json& object,
                     const std::function<void(const std::string& name, const Json& value)>& use);
[[noreturn]] void throw_wrong_kind();

// Adds the members that `defaults` has and `record` lacks, at every depth.
void fill(Json& record, const Json& defaults);

}  // namespace json_values
}  // namespace isomesh
