#pragma once

#include <string>

#include "server/store/postgresql/connection.h"

namespace isomesh::store::postgresql {

// A task that one process of a cluster has at a time. An advisory lock of the database, held while
// its connection lives, so it is released when the process dies.
class ExclusiveTask {
 public:
  // Throws Error kUnavailable if the database does not respond.
  ExclusiveTask(const std::string& url, const std::string& name) : connection_(url) {
    Rows row = connection_.query(
        "SELECT pg_try_advisory_lock(hashtext('isomesh ' || ?1), hashtext(current_schema()))",
        name);
    row.next();
    is_ours_ = row.boolean(0);
  }

  // False if another process has it.
  bool is_ours() const { return is_ours_; }

 private:
  Connection connection_;
  bool is_ours_ = false;
};

}  // namespace isomesh::store::postgresql
