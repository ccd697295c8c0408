#pragma once

#include <string>

#include "server/store/postgresql/connection.h"

namespace isomesh::store::postgresql {

// Exclusive task of one process in a cluster. An advisory lock of the database, held while its
// connection lives, so it is released when the process dies.
class Turn {
 public:
  // `what` names the task. Throws Error kUnavailable if the database does not respond.
  Turn(const std::string& url, const std::string& what) : connection_(url) {
    Rows row = connection_.query(
        "SELECT pg_try_advisory_lock(hashtext('isomesh ' || ?1), hashtext(current_schema()))",
        what);
    row.next();
    is_taken_ = row.boolean(0);
  }

  // False if another process has it.
  bool is_taken() const { return is_taken_; }

 private:
  Connection connection_;
  bool is_taken_ = false;
};

}  // namespace isomesh::store::postgresql
