// Connections, statements and transactions of SQLite for the interface in sql.h. Private to this
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
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/mutex.h"
#include "server/store/sql/sql.h"

struct sqlite3;
struct sqlite3_stmt;

namespace isomesh::store {

// Failures that a commit survives. All commits survive any end of the process.
enum class Durability {
  kFull,     // also a power failure
  kProcess,  // not a power failure; for changes that can be repeated without harm
};

// A group commit of several threads: one transaction of SQLite, in which each thread's part is a
// savepoint. Guarded by the connection's mutex.
struct Batch {
  Durability durability = Durability::kFull;
  std::size_t members = 0;  // number of completed parts
  bool has_ended = false;
  std::optional<Error> failure;  // of the commit; then no part took effect
  std::vector<std::function<void(bool is_committed)>> at_end;
};

// One connection. Use it only under the lock of a Transaction or a Reading.
class Connection : public SqlConnection {
 public:
  enum class Mode { kWrite, kRead };

  // Opens the file; creates it for writing. Throws Error kInternal if it is not a database.
  Connection(const std::filesystem::path& path, Mode mode);
  ~Connection() override;
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  Rows ask(std::string_view sql, std::span<const Parameter> parameters) override;
  // As ask(), but reads all rows, so that they block nothing.
  Rows take(std::string_view sql, std::span<const Parameter> parameters);
  std::size_t tell(std::string_view sql, std::span<const Parameter> parameters) override;
  // Not needed: a transaction has the connection exclusively, and no other connection writes.
  const char* for_update() const override { return ""; }
  void script(const std::string& sql) override;
  bool has_table(const std::string& name) override;
  const char* key_type() const override { return "TEXT"; }
  const char* end_of_keyed_table() const override { return " WITHOUT ROWID"; }
  void lock_table(const std::string&) override {}

  // Sets the newest certain time for `isomesh_kept`. `newest_us` must outlive this object.
  void know_newest(const std::atomic<std::int64_t>& newest_us);

  // Sets a function that returns false if the disk of the file is missing or cannot be written to.
  // Errors of the disk are Error kUnavailable then.
  void know_disk(std::function<bool()> responds) { disk_responds_ = std::move(responds); }

  // The error of the last call.
  Error last_error() const;

  // Checkpoints the write-ahead log when it reaches this size, and truncates it at twice the size,
  // which waits for readers.
  void limit_log(std::uint64_t bytes);

  // Ends an open batch, then checkpoints and truncates if possible. For holders of the mutex.
  void empty_log() noexcept;

  // Number of rows changed since the file was opened.
  std::int64_t all_changes() const;

  Mutex& mutex() { return mutex_; }

  // True if a Reading has or awaits the connection; may change at once.
  bool is_busy() const { return readings_ > 0; }

  // Number of threads that wait to begin a transaction; may change at once.
  std::size_t coming() const { return coming_; }

 private:
  friend class Reading;
  friend class Transaction;

  // For the next transaction's commit.
  void set_durability(Durability durability);

  // Rolls back an open transaction.
  void roll_back() noexcept;
  bool has_open_transaction() const;

  // For holders of the mutex.
  void end_batch(std::optional<Error> failure = std::nullopt) noexcept;
  Error error_of(int code) const;

  static int look_at_log(void* connection, sqlite3* handle, const char* name, int pages);
  sqlite3_stmt* prepared(std::string_view sql);

  sqlite3* handle_ = nullptr;
  int log_pages_ = 0;
  std::function<bool()> disk_responds_;
  Mutex mutex_;
  std::atomic<int> readings_ = 0;
  Durability durability_ = Durability::kFull;
  struct Hash : std::hash<std::string_view> {
    using is_transparent = void;  // NOLINT(readability-identifier-naming)
  };
  std::unordered_map<std::string, sqlite3_stmt*, Hash, std::equal_to<>> statements_;
  std::shared_ptr<Batch> batch_;         // of the open transaction
  std::atomic<std::size_t> coming_ = 0;  // threads that wait to begin a transaction
  Condition batch_ended_;
};

// A transaction. Rolled back on destruction unless committed. Transactions that start while others
// wait for the disk are committed together, with one sync; none is visible before that. Release all
// rows of it before the commit.
class Transaction {
 public:
  // Throws Error kOutOfSpace or kInternal.
  explicit Transaction(Connection& connection, Durability durability = Durability::kFull);
  ~Transaction();
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;

  Connection* operator->() const { return &connection_; }
  Connection& connection() const { return connection_; }

  // If commit() is called, runs `call` once its outcome is known and before another transaction
  // begins. May run in another thread. Must not throw.
  void at_end(std::function<void(bool is_committed)> call);

  // False once commit() has released the transaction, whatever its outcome.
  bool is_open() const { return open_; }

  // On return the transaction is committed. If this throws Error kOutOfSpace or kInternal, it is
  // rolled back; other transactions may have been committed meanwhile.
  void commit();

 private:
  void begin(Durability durability);
  void leave() noexcept;

  Connection& connection_;
  Lock lock_;
  bool open_ = true;
  std::vector<std::function<void(bool is_committed)>> at_end_;
};

// A read of committed data. Holds its connection, so process results after its end.
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

  const Count count_;  // first, so that waiting threads count
  const Lock lock_;
  Connection& connection_;
};

}  // namespace isomesh::store
