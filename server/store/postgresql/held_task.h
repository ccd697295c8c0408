#pragma once

#include <chrono>
#include <functional>
#include <string>
#include <utility>

#include "base/mutex.h"
#include "server/store/blob_store.h"
#include "server/store/postgresql/connection.h"
#include "server/store/postgresql/database.h"

namespace isomesh::store::postgresql {

struct HeldTaskOptions {
  // Time after which another process may take the task from one that does not keep it.
  std::chrono::milliseconds lease{30'000};
  // Time after which its holder no longer relies on it. The rest of the lease is for ending what it
  // does: a call of keep() may take some seconds, and work does not end at once.
  std::chrono::milliseconds sure{20'000};
  std::function<Steady()> now = [] { return Steady::clock::now(); };
};

// A task that one process of a cluster has for long. It is a lease in the database, because a lock
// would end with its session, unnoticed, at each restart of the database. A process that starts on
// the data folder of the holder takes the task at once. Thread safe.
class HeldTask {
 public:
  // Takes nothing yet. The database must outlive it.
  HeldTask(Database& database, std::string name, HeldTaskOptions options = {})
      : database_(database), name_(std::move(name)), options_(std::move(options)) {}
  // Lets other processes take it at once.
  ~HeldTask();
  HeldTask(const HeldTask&) = delete;
  HeldTask& operator=(const HeldTask&) = delete;

  // Takes the task or extends its lease. Returns an empty text if this process has it until the
  // next call, which must come soon; otherwise why it has not. Does not throw.
  std::string keep();

  // False if another process has taken the task. Until the transaction ends, none can, so what it
  // writes is written by the holder.
  bool is_ours(SqlConnection& connection) const;

 private:
  Database& database_;
  const std::string name_;
  const HeldTaskOptions options_;
  Mutex mutex_;
  Steady sure_until_ ISOMESH_GUARDED_BY(mutex_) = {};
};

// A task that one process of a cluster has at a time, until this object goes. An advisory lock of
// the database, so it is also released when the process dies and its connection with it.
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
  ~ExclusiveTask();
  ExclusiveTask(const ExclusiveTask&) = delete;
  ExclusiveTask& operator=(const ExclusiveTask&) = delete;

  // False if another process has it.
  bool is_ours() const { return is_ours_; }

 private:
  Connection connection_;
  bool is_ours_ = false;
};

}  // namespace isomesh::store::postgresql
