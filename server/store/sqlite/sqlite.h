// SQLite behind the interface of SQL: a connection, its statements, transactions. Private to this
// folder.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "base/error.h"
#include "base/mutex.h"
#include "server/store/sql/sql.h"

struct sqlite3;
struct sqlite3_stmt;

namespace isomesh::store {

// What a commit outlives. All of them outlive the process, however it ends.
enum class Durability {
  kFull,     // also a machine that loses its power
  kProcess,  // what a power cut may take back, for changes that are made again without harm
};

// What several threads commit together: one transaction of SQLite, each thread's part a savepoint
// in it. Guarded by the connection's mutex.
struct Batch {
  Durability durability = Durability::kFull;
  std::size_t members = 0;  // whose part is done
  bool has_ended = false;
  std::optional<Error> failure;  // of the commit: then no part took place
  std::vector<std::function<void(bool is_committed)>> at_end;
};

// One connection. What it does is done under the lock of a Transaction or a Reading.
class Connection : public SqlConnection {
 public:
  enum class Mode { kWrite, kRead };

  // Opens the file; creates it for writing. Throws Error kInternal when it is no database.
  Connection(const std::filesystem::path& path, Mode mode);
  ~Connection() override;
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  Rows ask(std::string_view sql, std::span<const Parameter> parameters) override;
  // The same with all rows read, so that these hold nothing any more.
  Rows take(std::string_view sql, std::span<const Parameter> parameters);
  std::size_t tell(std::string_view sql, std::span<const Parameter> parameters) override;
  // A transaction has the connection, and no other one writes.
  const char* for_update() const override { return ""; }
  void lock_table(const std::string&) override {}

  // Gives texts `isomesh_kept`, by the newest time that is known, which must outlive this.
  void know_newest(const std::atomic<std::int64_t>& newest_us);

  // Several statements without parameters.
  void script(const char* sql);

  // From now on the log of changes is brought into the file when it is so long; at twice that it is
  // cut, for which those who read are waited for.
  void limit_log(std::uint64_t bytes);

  // Does both now. Throws Error kOutOfSpace or kInternal.
  void empty_log();

  // How many rows were changed since it was opened.
  std::int64_t all_changes() const;

  Mutex& mutex() { return mutex_; }

  // Whether a Reading has it or waits for it; another thread may change that at once.
  bool is_busy() const { return readings_ > 0; }

  // How many threads wait to begin a transaction; others may come at once.
  std::size_t coming() const { return coming_; }

 private:
  friend class Reading;
  friend class Transaction;

  // What the next transaction's commit outlives.
  void set_durability(Durability durability);

  // Rolls back what is open.
  void roll_back() noexcept;
  bool has_open_transaction() const;

  // Those that hold the mutex share this.
  void end_batch(std::optional<Error> failure = std::nullopt) noexcept;
  Error last_error() const;

  static int look_at_log(void* connection, sqlite3* handle, const char* name, int pages);
  sqlite3_stmt* prepared(std::string_view sql);

  sqlite3* handle_ = nullptr;
  int log_pages_ = 0;
  Mutex mutex_;
  std::atomic<int> readings_ = 0;
  Durability durability_ = Durability::kFull;
  struct Hash : std::hash<std::string_view> {
    using is_transparent = void;  // NOLINT(readability-identifier-naming)
  };
  std::unordered_map<std::string, sqlite3_stmt*, Hash, std::equal_to<>> statements_;
  std::shared_ptr<Batch> batch_;         // of the transaction that is open
  std::atomic<std::size_t> coming_ = 0;  // threads that wait to begin a transaction
  Condition batch_ended_;
};

// All or nothing: what was not committed is rolled back when it goes. Those that come while others
// wait for the disk are committed together, with one sync; nobody else sees any of it before that.
// No Query of it may be in use when it commits.
class Transaction {
 public:
  // Throws Error kOutOfSpace or kInternal.
  explicit Transaction(Connection& connection, Durability durability = Durability::kFull);
  ~Transaction();
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;

  Connection* operator->() const { return &connection_; }
  Connection& connection() const { return connection_; }

  // To be called, if commit() is, when it is known whether this was committed, before anybody
  // else's transaction begins. May run in another thread. Must not throw.
  void at_end(std::function<void(bool is_committed)> call);

  // False once commit() has let go of it, whatever came of that.
  bool is_open() const { return open_; }

  // When it returns this is committed. Throws Error kOutOfSpace or kInternal: then it is rolled
  // back. Others may have committed theirs meanwhile.
  void commit();

 private:
  void begin(Durability durability);
  void leave() noexcept;

  Connection& connection_;
  Lock lock_;
  bool open_ = true;
  std::vector<std::function<void(bool is_committed)>> at_end_;
};

// Reads what is committed. Holds its connection, so what takes long with what was read is to be
// done afterwards.
class Reading {
 public:
  explicit Reading(Connection& connection)
      : count_(connection.readings_), lock_(connection.mutex()), connection_(connection) {}

  Connection* operator->() const { return &connection_; }
  Connection& connection() const { return connection_; }

 private:
  struct Count {
    explicit Count(std::atomic<int>& all) : readings(all) { ++readings; }
    ~Count() { --readings; }
    Count(const Count&) = delete;
    Count& operator=(const Count&) = delete;
    std::atomic<int>& readings;
  };

  const Count count_;  // first, so that who waits is counted
  const Lock lock_;
  Connection& connection_;
};

}  // namespace isomesh::store
