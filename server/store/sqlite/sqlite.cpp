#include "server/store/sqlite/sqlite.h"

#include <sqlite3.h>

#include "proto/error.h"

namespace isomesh::store {
namespace {

constexpr int kBusyTimeoutMs = 10'000;
// How long the log of changes grows before they are brought into the file itself: 16 MiB, so that a
// commit seldom has to do that, and pages that changed often are written once.
constexpr const char* kLogPages = "PRAGMA wal_autocheckpoint=4000";

[[noreturn]] void fail(sqlite3* handle, int code) {
  const int primary = code & 0xFF;
  // Most of what SQLite calls an I/O error is a write that found no room, too.
  if (primary == SQLITE_FULL || code == SQLITE_IOERR_WRITE || code == SQLITE_IOERR_SHMSIZE) {
    throw Error(ErrorCode::kOutOfSpace, "the data folder has no space left");
  }
  const std::string reason = handle == nullptr ? sqlite3_errstr(code) : sqlite3_errmsg(handle);
  throw Error(ErrorCode::kInternal, "the database: " + reason);
}

}  // namespace

Query::~Query() {
  sqlite3_reset(statement_);
  sqlite3_clear_bindings(statement_);
}

bool Query::next() {
  const int code = sqlite3_step(statement_);
  if (code == SQLITE_ROW) return true;
  if (code == SQLITE_DONE) return false;
  sqlite3* handle = sqlite3_db_handle(statement_);
  fail(handle, sqlite3_extended_errcode(handle));
}

bool Query::is_null(int column) const {
  return sqlite3_column_type(statement_, column) == SQLITE_NULL;
}

std::int64_t Query::integer(int column) const { return sqlite3_column_int64(statement_, column); }

double Query::real(int column) const { return sqlite3_column_double(statement_, column); }

std::string Query::text(int column) const {
  const unsigned char* text = sqlite3_column_text(statement_, column);
  const int bytes = sqlite3_column_bytes(statement_, column);
  return {reinterpret_cast<const char*>(text), static_cast<std::size_t>(bytes)};
}

void Query::bind(int parameter, std::string_view value) {
  sqlite3_bind_text64(statement_, parameter, value.data(), value.size(), SQLITE_TRANSIENT,
                      SQLITE_UTF8);
}

void Query::bind(int parameter, double value) { sqlite3_bind_double(statement_, parameter, value); }

void Query::bind(int parameter, std::int64_t value) {
  sqlite3_bind_int64(statement_, parameter, value);
}

void Query::bind(int parameter, std::nullptr_t) { sqlite3_bind_null(statement_, parameter); }

Connection::Connection(const std::filesystem::path& path, Mode mode) {
  const int access =
      mode == Mode::kWrite ? SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE : SQLITE_OPEN_READONLY;
  // Our own mutex keeps threads apart.
  const int code = sqlite3_open_v2(path.c_str(), &handle_, access | SQLITE_OPEN_NOMUTEX, nullptr);
  try {
    if (code != SQLITE_OK) fail(handle_, code);
    sqlite3_busy_timeout(handle_, kBusyTimeoutMs);
    if (mode == Mode::kRead) return;
    script("PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL; PRAGMA foreign_keys=ON;");
    script(kLogPages);
  } catch (...) {
    sqlite3_close(handle_);
    throw;
  }
}

Connection::~Connection() {
  for (const auto& [sql, statement] : statements_) sqlite3_finalize(statement);
  sqlite3_close(handle_);
}

void Connection::script(const char* sql) {
  const int code = sqlite3_exec(handle_, sql, nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) fail(handle_, sqlite3_extended_errcode(handle_));
}

void Connection::set_durability(Durability durability) {
  if (durability == durability_) return;
  script(durability == Durability::kFull ? "PRAGMA synchronous=FULL" : "PRAGMA synchronous=NORMAL");
  durability_ = durability;
}

void Connection::roll_back() noexcept {
  if (sqlite3_get_autocommit(handle_) == 0) {
    sqlite3_exec(handle_, "ROLLBACK", nullptr, nullptr, nullptr);
  }
}

sqlite3_stmt* Connection::prepared(std::string_view sql) {
  sqlite3_stmt*& statement = statements_[std::string(sql)];
  if (statement == nullptr) {
    const int code = sqlite3_prepare_v3(handle_, sql.data(), static_cast<int>(sql.size()),
                                        SQLITE_PREPARE_PERSISTENT, &statement, nullptr);
    if (code != SQLITE_OK) fail(handle_, code);
  }
  return statement;
}

int Connection::changes() const { return sqlite3_changes(handle_); }

std::int64_t Connection::all_changes() const { return sqlite3_total_changes64(handle_); }

Transaction::Transaction(Connection& connection, Durability durability)
    : lock_(connection.mutex()), connection_(connection) {
  connection_.set_durability(durability);
  connection_.run("BEGIN IMMEDIATE");
}

Transaction::~Transaction() {
  if (open_) connection_.roll_back();
}

void Transaction::commit() {
  connection_.run("COMMIT");
  open_ = false;
}

}  // namespace isomesh::store
