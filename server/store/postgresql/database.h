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

namespace isomesh::store::postgresql {

struct DatabaseOptions {
  std::string url;   // as libpq takes it; passwords may come from PGPASSFILE
  std::string node;  // the name of this process's data folder: it has one process at a time
  std::size_t connections = 16;
  // For how long an answer is waited for, and what was interrupted is asked again, before that is
  // an error.
  std::chrono::milliseconds patience{5000};
};

// The records of a cluster: one PostgreSQL database that any number of processes use, this one with
// a small pool of connections. What a process does in the database it does under the name of one
// life, its node. Thread safe.
class Database : public SqlDatabase {
 public:
  // Creates what is missing and brings the tables of an older version up to date. Throws Error
  // kUnavailable, with libpq's reason, if no connection can be made, or if a newer version made
  // them, kInternal otherwise. The text is for the operator.
  explicit Database(DatabaseOptions options);

  // Runs `act(connection)` and again while it is interrupted, so `act` must be one that may be
  // asked twice; is_again says that it is not the first time. Throws what it throws.
  template <class Act>
  auto ask(const Act& act) {
    return ask_for(options_.patience, act);
  }

  // The same for what may take longer. What has to be repeated is begun anew for options.patience.
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

  // Whether the database answers now.
  bool answers();

  const std::string& node() const { return node_; }  // a UUID of this life
  const std::string& node_name() const { return options_.node; }
  const std::string& url() const { return options_.url; }

  // Microseconds since 1970 by the database's clock: how the tables keep time. It is asked for with
  // each new connection, and the time that passes is added.
  std::int64_t now_us() const;
  // Of a time by this machine's clock, and back.
  std::int64_t to_us(Time time) const override;
  Time from_us(std::int64_t us) const override;
  std::size_t most_at_once() const override { return 1; }
  // When that was, as the time that passes is counted here.
  std::chrono::steady_clock::time_point steady_of(std::int64_t us) const;
  std::int64_t us_of(std::chrono::steady_clock::time_point time) const;

 private:
  // One connection of the pool, for as long as it lives.
  class Borrowed {
   public:
    // Waits for it, and it for its answers, until then.
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

  // What is to be added to this machine's clock to get the database's.
  std::int64_t shift() const;
  void look_at_clock(Connection& connection);

  const DatabaseOptions options_;
  const std::string node_;
  // The database's clock less the steady one, and less this machine's. They change when they are
  // wrong by a second, so that a time that goes there and back is the same.
  std::atomic<std::int64_t> beyond_steady_us_ = 0;
  mutable std::atomic<std::int64_t> shift_us_ = 0;

  Mutex mutex_;
  Condition given_;
  std::vector<std::unique_ptr<Connection>> idle_ ISOMESH_GUARDED_BY(mutex_);
  std::size_t open_ ISOMESH_GUARDED_BY(mutex_) = 0;
};

}  // namespace isomesh::store::postgresql
