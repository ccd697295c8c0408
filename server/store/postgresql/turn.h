#pragma once

#include <string>

#include "server/store/postgresql/connection.h"

namespace isomesh::store::postgresql {

// What one process of a cluster does at a time: a lock of the database that is held as long as its
// connection lives, so that it is free when the process dies.
class Turn {
 public:
  // `what` names it. Throws Error kUnavailable when nobody answers.
  Turn(const std::string& url, const std::string& what) : connection_(url) {
    Rows row = connection_.query(
        "SELECT pg_try_advisory_lock(hashtext('isomesh ' || ?1), hashtext(current_schema()))",
        what);
    row.next();
    is_taken_ = row.boolean(0);
  }

  // False: another process has it.
  bool is_taken() const { return is_taken_; }

 private:
  Connection connection_;
  bool is_taken_ = false;
};

}  // namespace isomesh::store::postgresql
