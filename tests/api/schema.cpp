#include "tests/api/schema.h"

#include <algorithm>
#include <set>
#include <stdexcept>

#include <gmock/gmock.h>

namespace isomesh::test {
namespace {

using nlohmann::json;
using Faults = std::vector<std::string>;

// Keywords that say nothing about the value, and those that are checked with another one.
const std::set<std::string> silent_keywords = {"title",   "description", "example",   "examples",
                                               "default", "format",      "properties"};

bool has_type(const json& value, const std::string& type) {
  if (type == "object") return value.is_object();
  if (type == "array") return value.is_array();
  if (type == "string") return value.is_string();
  if (type == "number") return value.is_number();
  if (type == "integer") return value.is_number_integer();
  if (type == "boolean") return value.is_boolean();
  if (type == "null") return value.is_null();
  throw std::runtime_error("the schema has the unknown type " + type);
}

class Validator {
 public:
  explicit Validator(const OpenApi& api) : api_(api) {}

  void check(const json& value, const YAML::Node& node, const std::string& where) {
    const YAML::Node schema = api_.resolved(node);
    for (const auto& keyword : schema) {
      check_keyword(value, schema, keyword.first.as<std::string>(), keyword.second, where);
    }
  }

  Faults faults;

 private:
  void fault(const std::string& where, const std::string& what) {
    faults.push_back((where.empty() ? "/" : where) + ": " + what);
  }

  void check_keyword(const json& value, const YAML::Node& schema, const std::string& keyword,
                     const YAML::Node& says, const std::string& where) {
    if (silent_keywords.contains(keyword) || keyword.starts_with("x-")) {
      if (keyword == "properties") check_properties(value, says, where);
    } else if (keyword == "type") {
      check_type(value, says, where);
    } else if (keyword == "required") {
      for (const std::string& name : texts_of(says)) {
        if (!value.contains(name)) fault(where, "has no " + name);
      }
    } else if (keyword == "additionalProperties") {
      check_additional(value, schema, says, where);
    } else if (keyword == "propertyNames") {
      for (const auto& [name, unused] : value.items()) check(name, says, where + '/' + name);
    } else if (keyword == "items") {
      for (std::size_t i = 0; value.is_array() && i < value.size(); ++i) {
        check(value[i], says, where + '/' + std::to_string(i));
      }
    } else if (keyword == "allOf") {
      for (const YAML::Node& part : says) check(value, part, where);
    } else if (keyword == "oneOf") {
      check_one(value, says, where);
    } else if (keyword == "enum") {
      const bool known = std::any_of(says.begin(), says.end(), [&](const YAML::Node& choice) {
        return json_of(choice) == value;
      });
      if (!known) fault(where, value.dump() + " is not in the enumeration");
    } else if (keyword == "const") {
      if (json_of(says) != value) fault(where, value.dump() + " is not the constant");
    } else if (keyword == "pattern") {
      const auto fits = testing::ContainsRegex(says.Scalar());
      if (value.is_string() && !testing::Matches(fits)(value.get<std::string>())) {
        fault(where, value.dump() + " does not match");
      }
    } else {
      check_size(value, keyword, says, where);
    }
  }

  void check_type(const json& value, const YAML::Node& says, const std::string& where) {
    const Faults types = says.IsSequence() ? texts_of(says) : Faults{says.Scalar()};
    if (std::ranges::none_of(types, [&](const auto& type) { return has_type(value, type); })) {
      fault(where, value.dump().substr(0, 60) + " is not of its type");
    }
  }

  void check_properties(const json& value, const YAML::Node& says, const std::string& where) {
    for (const auto& property : says) {
      const auto name = property.first.as<std::string>();
      if (value.contains(name)) check(value[name], property.second, where + '/' + name);
    }
  }

  void check_additional(const json& value, const YAML::Node& schema, const YAML::Node& says,
                        const std::string& where) {
    if (!value.is_object()) return;
    for (const auto& [name, member] : value.items()) {
      if (schema["properties"] && schema["properties"][name]) continue;
      if (says.IsMap()) {
        check(member, says, where + '/' + name);
      } else {
        fault(where, "has the unknown member " + name);
      }
    }
  }

  void check_one(const json& value, const YAML::Node& says, const std::string& where) {
    int fitting = 0;
    Faults all;
    for (const YAML::Node& choice : says) {
      const Faults wrong = api_.faults(value, choice);
      fitting += wrong.empty() ? 1 : 0;
      all.insert(all.end(), wrong.begin(), wrong.end());
    }
    if (fitting == 1) return;
    fault(where, std::to_string(fitting) + " choices fit");
    for (const std::string& wrong : all) fault(where, wrong);
  }

  void check_size(const json& value, const std::string& keyword, const YAML::Node& says,
                  const std::string& where) {
    if (value.is_null()) return;  // limits bind numbers and lists only
    const auto limit = says.as<double>();
    const double number = value.is_number() ? value.get<double>() : 0;
    const auto count = static_cast<double>(value.size());
    const bool fits =
        keyword == "minimum"            ? number >= limit
        : keyword == "maximum"          ? number <= limit
        : keyword == "exclusiveMinimum" ? number > limit
        : keyword == "maxLength"        ? value.get<std::string>().size() <= says.as<std::size_t>()
        : keyword == "minItems"         ? count >= limit
        : keyword == "maxItems"         ? count <= limit
                                : throw std::runtime_error("the unknown keyword " + keyword);
    if (!fits) fault(where, value.dump() + " breaks " + keyword);
  }

  const OpenApi& api_;
};

}  // namespace

YAML::Node OpenApi::resolved(const YAML::Node& node) const {
  if (!node.IsMap() || !node["$ref"]) return node;
  const auto reference = node["$ref"].as<std::string>();
  YAML::Node found;
  found.reset(root_);
  std::string token;
  for (std::size_t begin = 2; begin < reference.size(); begin += token.size() + 1) {
    token = reference.substr(begin, reference.find('/', begin) - begin);
    found.reset(found[token]);
    if (!found) throw std::runtime_error("nothing is at " + reference);
  }
  return found;
}

std::vector<std::string> OpenApi::faults(const json& value, const YAML::Node& schema) const {
  Validator validator(*this);
  validator.check(value, schema, "");
  return validator.faults;
}

nlohmann::json json_of(const YAML::Node& node) {
  json value;
  if (node.IsMap()) {
    value = json::object();
    for (const auto& member : node) value[member.first.as<std::string>()] = json_of(member.second);
  } else if (node.IsSequence()) {
    value = json::array();
    for (const YAML::Node& element : node) value.push_back(json_of(element));
  } else {
    // Plain scalars that are JSON are what JSON says; all others, and quoted ones, are text.
    value = node.Tag() == "!" ? json(json::value_t::discarded)
                              : json::parse(node.Scalar(), nullptr, false);
    if (value.is_discarded()) value = node.Scalar();
  }
  return value;
}

std::vector<std::string> texts_of(const YAML::Node& sequence) {
  std::vector<std::string> texts;
  for (const YAML::Node& element : sequence) texts.push_back(element.as<std::string>());
  return texts;
}

}  // namespace isomesh::test
