#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <string_view>

#include "base/error.h"
#include "server/store/expiry.h"
#include "server/store/files/data_folder.h"
#include "server/store/microseconds.h"
#include "server/store/sqlite/sqlite.h"

namespace isomesh::store {

// The records of a data folder: one SQLite file (WAL, synchronous=FULL), with a connection that
// writes and some that read side by side, so that readers wait neither for the disk nor for whoever
// reads much. Thread safe; `folder` must outlive it.
class Database : public SqlDatabase {
 public:
  // Creates what is missing and brings the tables of an older version up to date. Throws Error
  // kUnavailable when another version made it that this one does not know, kOutOfSpace or
  // kInternal.
  explicit Database(const DataFolder& folder);

  Connection& writer() { return writer_; }
  // One that nobody uses, where there is one.
  Connection& reader();

  // Tells which time it is for certain: what is kept from now on is never older.
  void know_newest(Time time) { newest_us_ = store::to_us(time); }

  // How many rows were changed since it was opened.
  std::int64_t changes();

  std::int64_t to_us(Time time) const override { return store::to_us(time); }
  Time from_us(std::int64_t us) const override { return store::from_us(us); }
  std::size_t most_at_once() const override { return std::numeric_limits<std::size_t>::max(); }

  // Does what frees room, or has to be kept in mind whatever the disk is like: where there is no
  // room for that, the reserve is let go first. `run` is one transaction. Throws what it throws.
  template <class Run>
  auto freeing(const Run& run) {
    try {
      return run();
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kOutOfSpace || !make_way()) throw;
    }
    return run();
  }

 private:
  void in_transaction(Change kind, const std::function<void(SqlTransaction&)>& act) override;
  void while_reading(const std::function<void(SqlConnection&)>& act) override;
  std::size_t tell(Change kind, std::string_view sql,
                   std::span<const Parameter> parameters) override;
  Rows ask(std::string_view sql, std::span<const Parameter> parameters) override;
  bool make_way();

  const DataFolder& folder_;
  std::atomic<std::int64_t> newest_us_ = 0;
  Connection writer_;
  static constexpr std::size_t kReaders = 6;
  std::array<std::unique_ptr<Connection>, kReaders> readers_;
  std::atomic<std::size_t> next_ = 0;  // whose turn it is when all are used
};

// Microseconds since 1970 by this machine's clock.
std::int64_t now_us();

}  // namespace isomesh::store
