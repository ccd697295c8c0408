// The public description beside a running daemon with a finished job.
#pragma once

#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/api/daemon.h"
#include "tests/api/schema.h"

namespace isomesh::test {

inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t found = text.find(from);
  return found == std::string::npos ? text : text.replace(found, from.size(), to);
}

class OpenApiTest : public testing::Test {
 protected:
  std::vector<std::string> faults(const std::string& body, const std::string& schema) {
    return api_.faults(nlohmann::json::parse(body), api_.schema(schema));
  }

  // The methods of a path as the server's Allow header would name them.
  static std::set<std::string> methods_of(const YAML::Node& path_item) {
    std::set<std::string> methods;
    if (path_item["get"]) methods.insert({"GET", "HEAD"});
    if (path_item["post"]) methods.insert("POST");
    if (path_item["delete"]) methods.insert("DELETE");
    if (path_item["patch"]) methods.insert("PATCH");
    return methods;
  }

  // A path with the ids of what is there.
  std::string example_of(const std::string& path) {
    const bool of_volume = path.starts_with("/v1/volumes");
    const std::string& id = of_volume ? job_.parameters.volume : job_.id;
    return replaced(replaced(path, "{format}", "drc"), "{id}", id);
  }

  Daemon daemon_;
  const Job job_ = finished_job(daemon_);
  const OpenApi api_{daemon_.get("/openapi.yaml").body};
};

}  // namespace isomesh::test
