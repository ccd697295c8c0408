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
#include <vector>

#include "base/error.h"
#include "server/store/expiry.h"
#include "server/store/files/data_folder.h"
#include "server/store/microseconds.h"
#include "server/store/sql/schema.h"
#include "server/store/sqlite/sqlite.h"

namespace isomesh::store {

// The records of a data folder: one SQLite file (WAL, synchronous=FULL). One connection writes and
// several read concurrently, so readers wait neither for syncs nor for long queries of others.
// Thread safe; `folder` must outlive this object.
class Database : public SqlDatabase {
 public:
  // Opens the tables of the service and of `components`: creates missing ones and upgrades those of
  // an older version. Throws Error kUnavailable as check_versions does; kOutOfSpace or kInternal.
  explicit Database(const DataFolder& folder, const std::vector<Schema>& components = {});

  Connection& writer() { return writer_; }
  // An idle connection if there is one.
  Connection& reader();

  // Sets a time that is certain to have passed: times that decide about expiry are never older.
  void know_newest(Time time) { newest_us_ = store::to_us(time); }

  // Of the service and the components.
  const std::vector<Schema>& schemas() const { return schemas_; }

  // Number of rows changed since the file was opened.
  std::int64_t changes();

  std::int64_t to_us(Time time) const override { return store::to_us(time); }
  Time from_us(std::int64_t us) const override { return store::from_us(us); }
  std::size_t most_at_once() const override { return std::numeric_limits<std::size_t>::max(); }

  // Runs one transaction that frees space or must be stored in any case. If there is no space for
  // it, releases the reserve and runs it again; another thread may have released the reserve
  // meanwhile. Throws what `run` throws.
  template <class Run>
  auto freeing(const Run& run) {
    try {
      return run();
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kOutOfSpace) throw;
    }
    make_way();
    return run();
  }

 private:
  void in_transaction(Change kind, const std::function<void(SqlTransaction&)>& act) override;
  void while_reading(const std::function<void(SqlConnection&)>& act) override;
  std::size_t tell(Change kind, std::string_view sql,
                   std::span<const Parameter> parameters) override;
  Rows ask(std::string_view sql, std::span<const Parameter> parameters) override;
  void make_way();

  const DataFolder& folder_;
  const std::vector<Schema> schemas_;
  std::atomic<std::int64_t> newest_us_ = 0;
  Connection writer_;
  static constexpr std::size_t kReaders = 6;
  std::array<std::unique_ptr<Connection>, kReaders> readers_;
  std::atomic<std::size_t> next_ = 0;  // the next reader if all are busy
};

// Throws Error kUnavailable as check_versions() of sql/schema.h does. Changes nothing.
void check_versions(Connection& connection, const std::vector<Schema>& components);

// Microseconds since 1970 by this machine's clock.
std::int64_t now_us();

}  // namespace isomesh::store
