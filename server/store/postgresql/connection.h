// Connections, statements and transactions of PostgreSQL for the interface in sql.h.
#pragma once

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "base/error.h"
#include "server/store/sql/sql.h"

struct pg_conn;
struct pg_result;

namespace isomesh::store::postgresql {

// The outcome of a statement is unknown: the connection is lost, or the database aborted the
// transaction in favour of another one. Repeatable work may be retried.
class Interrupted : public Error {
 public:
  using Error::Error;
};

// Throws Error kInvalidParameter if libpq cannot parse the URL, or if it contains a password: the
// list of processes and the output of `isomeshd check` would reveal it.
void check_url(const std::string& url);

// Certificates, keys and password files named by the URL or the environment, each with libpq's name
// of the parameter. Empty if the URL is invalid.
std::vector<std::pair<std::string, std::filesystem::path>> files_of_url(const std::string& url);

// The reason of libpq why no connection can be made; empty if one can. The text may name hosts,
// users and files, so show it to operators only. libpq never includes the password.
std::string reason_of_no_connection(const std::string& url);

// One connection. Not thread safe. Its errors reveal neither the address nor the password.
// Statements may also use PostgreSQL's parameters $1, $2 and so on.
class Connection : public SqlConnection {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::seconds kPatience{5};

  // Throws Interrupted if there is no connection by the deadline, whatever timeouts the URL sets.
  explicit Connection(const std::string& url,
                      Clock::time_point deadline = Clock::now() + kPatience);
  ~Connection() override;
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  // Sets the deadline for all further responses. A response that misses it makes the connection a
  // lost one, and throws Interrupted.
  void wait_until(Clock::time_point deadline) { deadline_ = deadline; }

  // Throws Interrupted, Error kOutOfSpace, kUnavailable or kInternal. tell() throws the same.
  Rows ask(std::string_view sql, std::span<const Parameter> parameters) override;
  std::size_t tell(std::string_view sql, std::span<const Parameter> parameters) override;
  void script(const std::string& sql) override;
  bool has_table(const std::string& name) override;
  const char* key_type() const override { return "text COLLATE \"C\""; }
  const char* end_of_keyed_table() const override { return ""; }
  const char* for_update() const override { return " FOR UPDATE"; }
  void lock_table(const std::string& name) override;

  // False once the connection is lost.
  bool is_open() const;

  // Becomes readable when data arrives.
  int socket() const;
  // Notifications from other connections on the channels that this one listens to.
  std::vector<std::string> take_messages();

 private:
  struct Clear {
    void operator()(pg_result* result) const;
  };
  using Result = std::unique_ptr<pg_result, Clear>;
  class ResultRows;

  Result execute(std::string_view sql, std::span<const Parameter> parameters);
  pg_result* result_of(bool is_asked);
  void wait_for(short events);
  Result checked(pg_result* result);
  const std::string& prepared(std::string_view sql, std::span<const Parameter> parameters);

  // Receives warnings of the server.
  static void take_notice(void* connection, const pg_result* notice);

  pg_conn* handle_ = nullptr;
  Clock::time_point deadline_;
  bool is_given_up_ = false;  // a response may still arrive; ignore it
  bool is_warned_ = false;    // the last commit may be on this machine only
  std::unordered_map<std::string, std::string> names_;  // of prepared statements
};

// A transaction. Rolled back on destruction unless committed.
class Transaction {
 public:
  explicit Transaction(Connection& connection) : connection_(connection) {
    connection_.run("BEGIN");
  }
  ~Transaction();
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;

  Connection* operator->() const { return &connection_; }
  Connection& connection() const { return connection_; }
  void commit();

 private:
  Connection& connection_;
  bool is_open_ = true;
};

}  // namespace isomesh::store::postgresql
