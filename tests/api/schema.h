// As much of JSON Schema as openapi.yaml uses, to hold answers against it.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>
#include <yaml-cpp/yaml.h>

namespace isomesh::test {

class OpenApi {
 public:
  explicit OpenApi(const std::string& yaml) : root_(YAML::Load(yaml)) {}

  YAML::Node paths() const { return root_["paths"]; }
  // Follows `$ref`, if that is what the node is.
  YAML::Node resolved(const YAML::Node& node) const;
  YAML::Node schema(const std::string& name) const { return root_["components"]["schemas"][name]; }

  // Faults of the value, each with its location; empty if it is valid. A member that the schema
  // does not name is a fault. Throws std::runtime_error for a keyword that is not known here.
  std::vector<std::string> faults(const nlohmann::json& value, const YAML::Node& schema) const;

 private:
  YAML::Node root_;
};

// A YAML node as JSON.
nlohmann::json json_of(const YAML::Node& node);

// The scalars of a sequence, as text.
std::vector<std::string> texts_of(const YAML::Node& sequence);

}  // namespace isomesh::test
