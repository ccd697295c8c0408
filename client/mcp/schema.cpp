#include "client/mcp/schema.h"

#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "proto/parameters.h"
#include "proto/types.h"

namespace isomesh::cli {
namespace {

using Object = nlohmann::ordered_json;

template <class T>
struct Plain {
  using Type = T;
};
template <class T>
struct Plain<std::optional<T>> {
  using Type = T;
};

// The JSON types of a member; empty for lists, maps and choices, which the text describes and the
// server checks.
template <class T>
Object types_of(const Parameter& parameter) {
  using Value = typename Plain<T>::Type;
  if constexpr (std::is_same_v<Value, SchemeName>) {
    return {"integer", "string"};
  } else if constexpr (std::is_same_v<Value, bool>) {
    return "boolean";
  } else if constexpr (std::is_integral_v<Value>) {
    return "integer";
  } else if constexpr (std::is_floating_point_v<Value>) {
    return parameter.takes_presets ? Object{"number", "string"} : Object("number");
  } else if constexpr (Enumeration<Value>) {
    return "string";
  } else {
    return nullptr;
  }
}

template <class T>
Object property_of(const Parameter& parameter) {
  Object property = Object::object();
  if (Object types = types_of<T>(parameter); !types.is_null()) property["type"] = std::move(types);
  std::string text = parameter.help;
  if (*parameter.more != '\0') text += std::string(" ") + parameter.more;
  if (*parameter.unit != '\0') text += std::string(" Unit: ") + parameter.unit + '.';
  property["description"] = text;
  if constexpr (Enumeration<T> && !std::is_same_v<T, SchemeName>) {
    property["enum"] = name_list<T>();
  }
  if (parameter.minimum) property["minimum"] = *parameter.minimum;
  if (parameter.above) property["exclusiveMinimum"] = *parameter.above;
  if (parameter.maximum) property["maximum"] = *parameter.maximum;
  return property;
}

Object object_schema() {
  return {{"type", "object"}, {"properties", Object::object()}, {"additionalProperties", false}};
}

}  // namespace

nlohmann::ordered_json job_schema() {
  JobParameters parameters;  // not constant, so that `visit` reaches members that may be absent
  Object schema = object_schema();
  visit_leaves(parameters, [&](const std::string& path, const Parameter& parameter, auto& member) {
    using Member = std::remove_reference_t<decltype(member)>;
    const bool is_own = std::is_same_v<Member, std::string> ||
                        std::is_same_v<Member, std::vector<MeshFormat>> ||
                        std::is_same_v<Member, std::optional<Callback>>;
    if (is_own) return;
    Object* parent = &schema;
    if (const std::size_t dot = path.find('.'); dot != std::string::npos) {
      Object& group = schema["properties"][path.substr(0, dot)];
      if (group.is_null()) group = object_schema();
      parent = &group;
    }
    (*parent)["properties"][parameter.name] = property_of<Member>(parameter);
  });
  return schema;
}

}  // namespace isomesh::cli
