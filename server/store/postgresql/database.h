#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/mutex.h"
#include "server/store/expiry.h"
#include "server/store/postgresql/connection.h"
#include "server/store/sql/schema.h"

namespace isomesh::store::postgresql {

struct DatabaseOptions {
  std::string url;   // in libpq's syntax; passwords may come from PGPASSFILE
  std::string node;  // of this process's data folder, which only one process uses at a time
  std::size_t connections = 16;
  // Time to wait for a response, and to retry interrupted work, before that is an error.
  std::chrono::milliseconds patience{5000};
  std::vector<Schema> components = {};  // beside the service's own tables
};

// The records of a cluster: one PostgreSQL database used by any number of processes. Each has a
// small pool of connections, and a node id that is new at every start and marks what it does in the
// database. Thread safe.
class Database : public SqlDatabase {
 public:
  // Creates missing tables and upgrades those of an older version. Throws Error kUnavailable, with
  // libpq's reason, if no connection can be made, and as check_versions() of sql/schema.h does;
  // kInternal otherwise. The text is for the operator.
  explicit Database(DatabaseOptions options);

  // Runs `act(connection, is_again)`, and repeats it while it is interrupted, so `act` must be
  // repeatable. is_again is true after the first time. Throws what `act` throws.
  template <class Act>
  auto ask(const Act& act) {
    return ask_for(options_.patience, act);
  }

  // As ask(), but a response may take `longest`. Interrupted work is restarted only within
  // options.patience of the call.
  template <class Act>
  auto ask_for(std::chrono::milliseconds longest, const Act& act) {
    const auto deadline = std::chrono::steady_clock::now() + options_.patience;
    for (bool is_again = false;; is_again = true) {
      try {
        const Borrowed borrowed(*this, deadline);
        if (longest > options_.patience) {
          borrowed.connection().wait_until(std::chrono::steady_clock::now() + longest);
        }
        return act(borrowed.connection(), is_again);
      } catch (const Interrupted&) {
        if (std::chrono::steady_clock::now() >= deadline) throw;
      }
      pause();
    }
  }

  bool responds();

  const std::string& node() const { return node_; }  // a UUID, new at each start of the process
  const std::string& node_name() const { return options_.node; }
  const std::string& url() const { return options_.url; }
  // Of the service and the components.
  const std::vector<Schema>& schemas() const { return schemas_; }

  // Microseconds since 1970 by the database's clock, as in the tables. Each new connection reads
  // that clock; in between, the steady clock advances it.
  std::int64_t now_us() const;
  // Converts between this machine's clock and the database's.
  std::int64_t to_us(Time time) const override;
  Time from_us(std::int64_t us) const override;
  std::size_t most_at_once() const override { return 1; }
  // The steady clock's value at that time.
  std::chrono::steady_clock::time_point steady_of(std::int64_t us) const;

 private:
  // A connection borrowed from the pool until destruction.
  class Borrowed {
   public:
    // Waits until the deadline for a connection; its responses have the same deadline.
    Borrowed(Database& database, std::chrono::steady_clock::time_point deadline)
        : database_(database), connection_(database.take(deadline)) {}
    ~Borrowed() { database_.give(std::move(connection_)); }
    Borrowed(const Borrowed&) = delete;
    Borrowed& operator=(const Borrowed&) = delete;
    Connection& connection() const { return *connection_; }

   private:
    Database& database_;
    std::unique_ptr<Connection> connection_;
  };

  void in_transaction(Change kind, const std::function<void(SqlTransaction&)>& act) override;
  void while_reading(const std::function<void(SqlConnection&)>& act) override;
  std::size_t tell(Change kind, std::string_view sql,
                   std::span<const Parameter> parameters) override;
  Rows ask(std::string_view sql, std::span<const Parameter> parameters) override;

  std::unique_ptr<Connection> take(std::chrono::steady_clock::time_point deadline);
  void give(std::unique_ptr<Connection> connection);
  static void pause();

  // Microseconds from this machine's clock to the database's.
  std::int64_t shift() const;
  void look_at_clock(Connection& connection);

  const DatabaseOptions options_;
  const std::vector<Schema> schemas_;
  const std::string node_;
  // The database's clock minus the steady clock, and minus this machine's clock. They are adjusted
  // only when wrong by a second, so that a time converted there and back is unchanged.
  std::atomic<std::int64_t> beyond_steady_us_ = 0;
  mutable std::atomic<std::int64_t> shift_us_ = 0;

  Mutex mutex_;
  Condition given_;
  std::vector<std::unique_ptr<Connection>> idle_ ISOMESH_GUARDED_BY(mutex_);
  std::size_t open_ ISOMESH_GUARDED_BY(mutex_) = 0;
};

// A connection for commands that read the audit trail beside daemons of any version: it changes
// nothing. Throws Error as Database does, and kNotFound if there are no tables.
std::unique_ptr<Connection> connect_to_trail(const std::string& url,
                                             const std::vector<Schema>& components);

}  // namespace isomesh::store::postgresql
