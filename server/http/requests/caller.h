#pragma once

#include <string>

namespace isomesh::http {

enum class Role {
  kUser,     // its own volumes and jobs
  kAdmin,    // all volumes and jobs, and the metrics
  kMonitor,  // only the metrics
};

// Without tokens every caller is an unnamed administrator.
struct Caller {
  std::string name;
  Role role = Role::kAdmin;

  bool operator==(const Caller&) const = default;
};

}  // namespace isomesh::http
