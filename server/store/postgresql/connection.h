// PostgreSQL behind the interface of SQL: a connection, its statements, transactions. Private to
// this folder.
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

// Nothing is known of what was asked: the connection is gone, or the database has ended the
// transaction in favour of another one. What may be repeated may be asked again.
class Interrupted : public Error {
 public:
  using Error::Error;
};

// Throws Error kInvalidParameter for a URL that libpq does not read, or that holds a password: it
// would be seen in the list of processes and in what `isomeshd check` prints.
void check_url(const std::string& url);

// Files of certificates, keys and passwords that the URL or the environment names, by libpq's words
// for them. None where the URL is not valid.
std::vector<std::pair<std::string, std::filesystem::path>> files_of_url(const std::string& url);

// Why no connection can be made, as libpq says it; empty if one can. The text may name hosts, users
// and files, so it is for the operator alone. libpq never puts a password into it.
std::string reason_of_no_connection(const std::string& url);

// One connection. Not thread safe. What it throws tells neither the address nor the password. Its
// texts may also have their parameters as PostgreSQL has them, $1, $2 and so on.
class Connection : public SqlConnection {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::seconds kPatience{5};

  // Throws Interrupted when nobody answers until then, whatever the URL says of time.
  explicit Connection(const std::string& url,
                      Clock::time_point deadline = Clock::now() + kPatience);
  ~Connection() override;
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  // Until when answers are waited for, from now on. An answer that has not come by then makes the
  // connection a lost one, and throws Interrupted.
  void wait_until(Clock::time_point deadline) { deadline_ = deadline; }

  // Throw Interrupted, Error kOutOfSpace, kUnavailable or kInternal.
  Rows ask(std::string_view sql, std::span<const Parameter> parameters) override;
  std::size_t tell(std::string_view sql, std::span<const Parameter> parameters) override;
  const char* for_update() const override { return " FOR UPDATE"; }
  void lock_table(const std::string& name) override;

  // Several statements without parameters.
  void script(const std::string& sql);

  // False once it has been lost.
  bool is_open() const;

  // A descriptor that is readable when something has come.
  int socket() const;
  // What was told to the channels that it listens to, by other connections.
  std::vector<std::string> take_messages();

 private:
  struct Clear {
    void operator()(pg_result* result) const;
  };
  using Result = std::unique_ptr<pg_result, Clear>;
  class Answer;

  Result execute(std::string_view sql, std::span<const Parameter> parameters);
  pg_result* answer_to(bool is_asked);
  void wait_for(short events);
  Result checked(pg_result* result);
  const std::string& prepared(std::string_view sql, std::span<const Parameter> parameters);

  // Sees what the other side warns of.
  static void take_notice(void* connection, const pg_result* notice);

  pg_conn* handle_ = nullptr;
  Clock::time_point deadline_;
  bool is_given_up_ = false;  // an answer may still come, to nobody
  bool is_warned_ = false;    // by the last statement: it may be on this machine only
  std::unordered_map<std::string, std::string> names_;  // of prepared statements
};

// All or nothing: what was not committed is rolled back when it goes.
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
