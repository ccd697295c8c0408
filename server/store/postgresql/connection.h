// PostgreSQL as C++ values: a connection, its statements, transactions. Private to this folder.
#pragma once

#include <charconv>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <unordered_map>
#include <vector>

#include "base/error.h"

struct pg_conn;
struct pg_result;

namespace isomesh::store::postgresql {

// Nothing is known of what was asked: the connection is gone, or the database has ended the
// transaction in favour of another one. What may be repeated may be asked again.
class Interrupted : public Error {
 public:
  using Error::Error;
};

// A parameter as PostgreSQL reads it; empty: NULL.
using Parameter = std::optional<std::string>;

inline Parameter parameter(std::nullptr_t) { return std::nullopt; }
inline Parameter parameter(std::string_view text) { return std::string(text); }
inline Parameter parameter(const char* text) { return std::string(text); }
inline Parameter parameter(bool value) { return std::string(value ? "t" : "f"); }
Parameter parameter(double value);
template <class T>
requires std::is_integral_v<T> || std::is_enum_v<T> Parameter parameter(T value) {
  return std::to_string(static_cast<std::int64_t>(value));
}
// Arrays.
Parameter parameter(const std::vector<std::string>& values);
Parameter parameter(const std::vector<std::int64_t>& values);
Parameter parameter(const std::vector<double>& values);
template <class T>
Parameter parameter(const std::optional<T>& value) {
  return value ? parameter(*value) : std::nullopt;
}

// What a statement has answered. Not thread safe.
class Rows {
 public:
  explicit Rows(pg_result* result);

  // The next row; false after the last.
  bool next() { return ++row_ < count_; }
  int count() const { return count_; }

  bool is_null(int column) const;
  std::int64_t integer(int column) const;
  bool boolean(int column) const;
  double real(int column) const;
  std::string text(int column) const;
  std::vector<double> reals(int column) const;  // of an array

  // How many rows the statement changed.
  std::size_t changed() const;

 private:
  std::string_view raw(int column) const;

  struct Clear {
    void operator()(pg_result* result) const;
  };
  std::unique_ptr<pg_result, Clear> result_;
  int count_ = 0;
  int row_ = -1;
};

// Throws Error kInvalidParameter for a URL that libpq does not read, or that holds a password: it
// would be seen in the list of processes and in what `isomeshd check` prints.
void check_url(const std::string& url);

// Why no connection can be made, as libpq says it; empty if one can. The text may name hosts, users
// and files, so it is for the operator alone. libpq never puts a password into it.
std::string reason_of_no_connection(const std::string& url);

// One connection; its statements are prepared once and kept. Not thread safe. What it throws tells
// neither the address nor the password.
class Connection {
 public:
  // Throws Interrupted when nobody answers.
  explicit Connection(const std::string& url);
  ~Connection();
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  // Throws Interrupted, Error kOutOfSpace, kUnavailable or kInternal.
  template <class... Values>
  Rows run(std::string_view sql, const Values&... values) {
    return execute(sql, {parameter(values)...});
  }

  // The same with parameters that are not known before.
  Rows execute(std::string_view sql, const std::vector<Parameter>& parameters);

  // Several statements without parameters.
  void script(const std::string& sql);

  // False once it has been lost.
  bool is_open() const;

  // A descriptor that is readable when something has come.
  int socket() const;
  // What was told to the channels that it listens to, by other connections.
  std::vector<std::string> take_messages();

 private:
  Rows checked(pg_result* result);
  const std::string& prepared(std::string_view sql);

  // Sees what the other side warns of.
  static void take_notice(void* connection, const pg_result* notice);

  pg_conn* handle_ = nullptr;
  bool is_warned_ = false;  // by the last statement: it may be on this machine only
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
