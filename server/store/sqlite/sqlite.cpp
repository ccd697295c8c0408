#include "server/store/sqlite/sqlite.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <iterator>
#include <utility>

#include <sqlite3.h>

#include "proto/error.h"
#include "proto/json_tree.h"
#include "server/store/damaged_records.h"
#include "server/store/files/data_folder.h"
#include "server/store/microseconds.h"
#include "server/store/sql/names.h"

namespace isomesh::store {
namespace {

constexpr int kBusyTimeoutMs = 10'000;

// Locks the mutex; `coming` counts the threads that wait for it.
Mutex& counted(Mutex& mutex, std::atomic<std::size_t>& coming) {
  ++coming;
  return mutex;
}

// A prepared statement in use. Clears its parameters on destruction.
class Statement : public Rows::Source {
 public:
  Statement(const Connection& connection, sqlite3_stmt* statement,
            std::span<const Parameter> parameters)
      : connection_(connection), statement_(statement) {
    int number = 0;
    for (const Parameter& parameter : parameters) bind(++number, parameter);
  }
  ~Statement() override {
    sqlite3_reset(statement_);
    sqlite3_clear_bindings(statement_);
  }
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;

  bool next() override {
    const int code = sqlite3_step(statement_);
    if (code == SQLITE_ROW) return true;
    if (code == SQLITE_DONE) return false;
    throw connection_.last_error();
  }

  int type(int column) const { return sqlite3_column_type(statement_, column); }
  bool is_null(int column) const override { return type(column) == SQLITE_NULL; }
  std::int64_t integer(int column) const override {
    return sqlite3_column_int64(statement_, column);
  }
  double real(int column) const override { return sqlite3_column_double(statement_, column); }
  std::string text(int column) const override {
    const unsigned char* text = sqlite3_column_text(statement_, column);
    const int bytes = sqlite3_column_bytes(statement_, column);
    return {reinterpret_cast<const char*>(text), static_cast<std::size_t>(bytes)};
  }

 private:
  void bind(int number, const Parameter& parameter) {
    if (parameter.is_null) {
      sqlite3_bind_null(statement_, number);
    } else if (parameter.type == Parameter::Type::kInteger) {
      sqlite3_bind_int64(statement_, number, parameter.integer);
    } else if (parameter.type == Parameter::Type::kReal) {
      sqlite3_bind_double(statement_, number, parameter.real);
    } else {
      sqlite3_bind_text64(statement_, number, parameter.text.data(), parameter.text.size(),
                          SQLITE_TRANSIENT, SQLITE_UTF8);
    }
  }

  const Connection& connection_;
  sqlite3_stmt* statement_;
};

// Rows held in memory.
class Taken : public Rows::Source {
 public:
  explicit Taken(sqlite3_stmt* statement) : columns_(sqlite3_column_count(statement)) {}

  // Keeps the types, because converting numbers to text takes time.
  void add(const Statement& row) {
    for (int column = 0; column < columns_; ++column) {
      Cell& cell = cells_.emplace_back();
      switch (row.type(column)) {
        case SQLITE_NULL:
          cell.is_null = true;
          break;
        case SQLITE_INTEGER:
          cell.integer = row.integer(column);
          cell.real = static_cast<double>(cell.integer);
          break;
        case SQLITE_FLOAT:
          cell.real = row.real(column);
          break;
        default:
          cell.text = row.text(column);
      }
    }
  }

  bool next() override { return static_cast<std::size_t>(++row_ * columns_) < cells_.size(); }
  bool is_null(int column) const override { return at(column).is_null; }
  std::int64_t integer(int column) const override { return at(column).integer; }
  double real(int column) const override { return at(column).real; }
  std::string text(int column) const override { return at(column).text; }

 private:
  struct Cell {
    bool is_null = false;
    std::int64_t integer = 0;
    double real = 0;
    std::string text;
  };

  const Cell& at(int column) const {
    return cells_[static_cast<std::size_t>(row_ * columns_ + column)];
  }

  const int columns_;
  int row_ = -1;
  std::vector<Cell> cells_;
};

void give_now(sqlite3_context* context, int, sqlite3_value**) {
  sqlite3_result_int64(context, to_us(std::chrono::system_clock::now()));
}

void give_kept(sqlite3_context* context, int, sqlite3_value** values) {
  const auto* newest = static_cast<const std::atomic<std::int64_t>*>(sqlite3_user_data(context));
  sqlite3_result_int64(context,
                       std::max<std::int64_t>(sqlite3_value_int64(values[0]), newest->load()));
}

}  // namespace

Connection::Connection(const std::filesystem::path& path, Mode mode) {
  const int access =
      mode == Mode::kWrite ? SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE : SQLITE_OPEN_READONLY;
  // The connection's own mutex serialises threads.
  const int code = sqlite3_open_v2(path.c_str(), &handle_, access | SQLITE_OPEN_NOMUTEX, nullptr);
  try {
    if (code != SQLITE_OK) throw error_of(code);
    sqlite3_busy_timeout(handle_, kBusyTimeoutMs);
    sqlite3_create_function_v2(handle_, "isomesh_now", 0, SQLITE_UTF8, nullptr, give_now, nullptr,
                               nullptr, nullptr);
    if (mode == Mode::kRead) return;
    script("PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL; PRAGMA foreign_keys=ON;");
  } catch (...) {
    sqlite3_close(handle_);
    throw;
  }
}

Connection::~Connection() {
  for (const auto& [sql, statement] : statements_) sqlite3_finalize(statement);
  sqlite3_close(handle_);
}

void Connection::know_newest(const std::atomic<std::int64_t>& newest_us) {
  // SQLite passes the pointer back unchanged.
  auto* given = const_cast<std::atomic<std::int64_t>*>(&newest_us);
  const int code = sqlite3_create_function_v2(handle_, "isomesh_kept", 1, SQLITE_UTF8, given,
                                              give_kept, nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) throw error_of(code);
}

void Connection::script(const std::string& sql) {
  const int code = sqlite3_exec(handle_, with_numbers(sql).c_str(), nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) throw last_error();
}

bool Connection::has_table(const std::string& name) {
  return query("SELECT 1 FROM sqlite_schema WHERE name = ?1", name).next();
}

void Connection::set_durability(Durability durability) {
  if (durability == durability_) return;
  script(durability == Durability::kFull ? "PRAGMA synchronous=FULL" : "PRAGMA synchronous=NORMAL");
  durability_ = durability;
}

void Connection::limit_log(std::uint64_t bytes) {
  Rows page = query("PRAGMA page_size");
  page.next();
  log_pages_ = static_cast<int>(bytes / static_cast<std::uint64_t>(page.integer(0)));
  script("PRAGMA journal_size_limit=" + std::to_string(bytes));
  sqlite3_wal_hook(handle_, look_at_log, this);
}

// Runs after a commit, which is valid whatever happens here. A failed checkpoint is retried after
// the next commit.
int Connection::look_at_log(void* connection, sqlite3* handle, const char* name, int pages) {
  const int limit = static_cast<Connection*>(connection)->log_pages_;
  if (pages < limit) return SQLITE_OK;
  const int mode = pages < 2 * limit ? SQLITE_CHECKPOINT_PASSIVE : SQLITE_CHECKPOINT_TRUNCATE;
  sqlite3_wal_checkpoint_v2(handle, name, mode, nullptr, nullptr);
  return SQLITE_OK;
}

void Connection::empty_log() noexcept {
  if (batch_) end_batch();
  sqlite3_wal_checkpoint_v2(handle_, nullptr, SQLITE_CHECKPOINT_TRUNCATE, nullptr, nullptr);
}

bool Connection::has_open_transaction() const { return sqlite3_get_autocommit(handle_) == 0; }

void Connection::roll_back() noexcept {
  if (has_open_transaction()) sqlite3_exec(handle_, "ROLLBACK", nullptr, nullptr, nullptr);
}

Error Connection::last_error() const { return error_of(sqlite3_extended_errcode(handle_)); }

Error Connection::error_of(int code) const {
  const int primary = code & 0xFF;
  const bool is_disks = primary == SQLITE_IOERR || primary == SQLITE_READONLY;
  if (is_disks && disk_responds_ && !disk_responds_()) return missing_folder();
  // Most I/O errors of SQLite are writes without space, too.
  if (primary == SQLITE_FULL || code == SQLITE_IOERR_WRITE || code == SQLITE_IOERR_SHMSIZE) {
    return {ErrorCode::kOutOfSpace, "the data folder has no space left"};
  }
  const int system = handle_ == nullptr ? 0 : sqlite3_system_errno(handle_);
  const bool is_short = primary == SQLITE_CANTOPEN && (system == EMFILE || system == ENFILE);
  if (primary == SQLITE_NOMEM || code == SQLITE_IOERR_NOMEM || is_short) {
    return {ErrorCode::kUnavailable, "the service is out of file descriptors or memory"};
  }
  const std::string reason = handle_ == nullptr ? sqlite3_errstr(code) : sqlite3_errmsg(handle_);
  // It may quote what a damaged database holds.
  const std::string detail = "the database: " + valid_utf8(reason);
  if (primary != SQLITE_CORRUPT) return {ErrorCode::kInternal, detail};
  return {ErrorCode::kInternal, detail, {{kDatabaseField, "is damaged: restore it from a backup"}}};
}

void Connection::end_batch(std::optional<Error> failure) noexcept {
  const std::shared_ptr<Batch> batch = std::exchange(batch_, nullptr);
  if (!failure && batch->members > 0) {
    try {
      run("COMMIT");
    } catch (const Error& error) {
      failure = error;
    }
  }
  roll_back();
  batch->failure = std::move(failure);
  batch->has_ended = true;
  for (const auto& call : batch->at_end) call(!batch->failure);
  batch_ended_.notify_all();
}

Rows Connection::ask(std::string_view sql, std::span<const Parameter> parameters) {
  return Rows(std::make_unique<Statement>(*this, prepared(sql), parameters));
}

Rows Connection::take(std::string_view sql, std::span<const Parameter> parameters) {
  sqlite3_stmt* const prepared_statement = prepared(sql);
  Statement statement(*this, prepared_statement, parameters);
  auto taken = std::make_unique<Taken>(prepared_statement);
  while (statement.next()) taken->add(statement);
  return Rows(std::move(taken));
}

std::size_t Connection::tell(std::string_view sql, std::span<const Parameter> parameters) {
  Statement statement(*this, prepared(sql), parameters);
  while (statement.next()) {
  }
  return static_cast<std::size_t>(sqlite3_changes(handle_));
}

sqlite3_stmt* Connection::prepared(std::string_view sql) {
  const auto known = statements_.find(sql);
  if (known != statements_.end()) return known->second;
  const std::string text = with_numbers(sql);
  sqlite3_stmt* statement = nullptr;
  const int code = sqlite3_prepare_v3(handle_, text.data(), static_cast<int>(text.size()),
                                      SQLITE_PREPARE_PERSISTENT, &statement, nullptr);
  if (code != SQLITE_OK) throw error_of(code);
  return statements_[std::string(sql)] = statement;
}

std::int64_t Connection::all_changes() const { return sqlite3_total_changes64(handle_); }

Transaction::Transaction(Connection& connection, Durability durability)
    : connection_(connection), lock_(counted(connection.mutex(), connection.coming_)) {
  --connection_.coming_;
  try {
    begin(durability);
  } catch (...) {
    leave();
    throw;
  }
}

Transaction::~Transaction() {
  if (open_) leave();
}

void Transaction::at_end(std::function<void(bool is_committed)> call) {
  at_end_.push_back(std::move(call));
}

void Transaction::begin(Durability durability) {
  std::shared_ptr<Batch>& batch = connection_.batch_;
  // A batch without sync cannot be upgraded, so a transaction that needs a sync ends it and starts
  // a new one.
  const bool is_too_weak = batch && batch->durability == Durability::kProcess;
  if (is_too_weak && durability == Durability::kFull) connection_.end_batch();
  if (!batch) {
    auto begun = std::make_shared<Batch>();
    begun->durability = durability;
    connection_.set_durability(durability);
    connection_.run("BEGIN IMMEDIATE");
    batch = std::move(begun);
  }
  connection_.run("SAVEPOINT part");
}

void Transaction::commit() {
  const std::shared_ptr<Batch> batch = connection_.batch_;
  // Before other threads rely on this one to end the batch: nothing fails afterwards.
  if (batch) batch->at_end.reserve(batch->at_end.size() + at_end_.size());
  connection_.run("RELEASE part");
  open_ = false;
  ++batch->members;
  std::ranges::move(at_end_, std::back_inserter(batch->at_end));
  // Waiting threads first add their parts. The last one commits for all.
  constexpr std::size_t kMostMembers = 64;
  if (connection_.coming_ == 0 || batch->members == kMostMembers) {
    connection_.end_batch();
  } else {
    connection_.batch_ended_.wait(lock_, [&] { return batch->has_ended; });
  }
  if (batch->failure) throw *batch->failure;
}

void Transaction::leave() noexcept {
  Batch* const batch = connection_.batch_.get();
  if (batch == nullptr) return;
  // SQLite rolls back the whole transaction if the disk is full or fails.
  if (!connection_.has_open_transaction()) return connection_.end_batch(connection_.last_error());
  try {
    connection_.run("ROLLBACK TO part");
    connection_.run("RELEASE part");
  } catch (const Error& error) {
    return connection_.end_batch(error);
  }
  if (batch->members == 0 || connection_.coming_ == 0) connection_.end_batch();
}

}  // namespace isomesh::store
