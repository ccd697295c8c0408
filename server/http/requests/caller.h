// Who sent a request, and what they may do.
#pragma once

#include <string>

namespace isomesh::http {

enum class Role {
  kUser,     // its own volumes and jobs
  kAdmin,    // everybody's, and the metrics
  kMonitor,  // the metrics and nothing else
};

// Who sent a request. Where no tokens are configured everybody is an administrator without a name.
struct Caller {
  std::string name;
  Role role = Role::kAdmin;

  bool operator==(const Caller&) const = default;
};

}  // namespace isomesh::http
