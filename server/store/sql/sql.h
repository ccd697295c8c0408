// SQL of whatever engine: one text for all, and what engines differ in behind interfaces. For
// stores only.
//
// A text has its parameters as ?1, ?2 and so on, and may have `isomesh_now()`, which is the time
// as the tables keep it: microseconds since 1970. What decides how long something is kept is
// written as `isomesh_kept(time)`: that time, or the newest that is known for certain where the
// clock has gone back behind that.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "server/store/expiry.h"

namespace isomesh::store {

// What is given for a parameter; a text must outlive it. Its type is known also where it is NULL.
struct Parameter {
  enum class Type {
    kInteger,
    kReal,
    kText,
    kOfColumn,  // a text that is read as what it is compared with or stored in
  };

  template <class T>
  requires std::is_integral_v<T> || std::is_enum_v<T>
  explicit Parameter(T value) : integer(static_cast<std::int64_t>(value)) {}
  explicit Parameter(double value) : type(Type::kReal), real(value) {}
  explicit Parameter(std::string_view value, Type as = Type::kText) : type(as), text(value) {}
  explicit Parameter(const std::string& value) : Parameter(std::string_view(value)) {}
  explicit Parameter(const char* value) : Parameter(std::string_view(value)) {}
  template <class T>
  explicit Parameter(const std::optional<T>& value)
      : Parameter(value ? Parameter(*value) : null<T>()) {}

  Type type = Type::kInteger;
  bool is_null = false;
  std::int64_t integer = 0;
  double real = 0;
  std::string_view text = {};

 private:
  template <class T>
  static Parameter null() {
    Parameter parameter{T()};
    parameter.is_null = true;
    parameter.text = {};
    return parameter;
  }
};

// What a statement has answered. Not thread safe.
class Rows {
 public:
  class Source {
   public:
    virtual ~Source() = default;
    virtual bool next() = 0;
    virtual bool is_null(int column) const = 0;
    virtual std::int64_t integer(int column) const = 0;
    virtual double real(int column) const = 0;
    virtual std::string text(int column) const = 0;
  };

  explicit Rows(std::unique_ptr<Source> source) : source_(std::move(source)) {}

  // The next row; false after the last.
  bool next() { return source_->next(); }

  bool is_null(int column) const { return source_->is_null(column); }
  std::int64_t integer(int column) const { return source_->integer(column); }
  bool boolean(int column) const { return integer(column) != 0; }
  std::size_t count(int column) const { return static_cast<std::size_t>(integer(column)); }
  double real(int column) const { return source_->real(column); }
  std::string text(int column) const { return source_->text(column); }

 private:
  std::unique_ptr<Source> source_;
};

// One connection. Statements are prepared once and kept.
class SqlConnection {
 public:
  virtual ~SqlConnection() = default;

  // At most one use of the same text at a time; rows are to be gone when a transaction commits.
  virtual Rows ask(std::string_view sql, std::span<const Parameter> parameters) = 0;
  // Runs a statement to its end; returns how many rows it changed.
  virtual std::size_t tell(std::string_view sql, std::span<const Parameter> parameters) = 0;

  // The same with values.
  template <class... Values>
  Rows query(std::string_view sql, const Values&... values) {
    const std::array<Parameter, sizeof...(Values)> parameters{Parameter(values)...};
    return ask(sql, parameters);
  }
  template <class... Values>
  std::size_t run(std::string_view sql, const Values&... values) {
    const std::array<Parameter, sizeof...(Values)> parameters{Parameter(values)...};
    return tell(sql, parameters);
  }

  // What ends a SELECT of rows that the transaction may change, so that nobody else does meanwhile:
  // " FOR UPDATE" where others can.
  virtual const char* for_update() const = 0;
  // Until the transaction ends, nobody else changes that table.
  virtual void lock_table(const std::string& name) = 0;
};

// All or nothing: what was not committed is rolled back.
class SqlTransaction {
 public:
  SqlTransaction(SqlConnection& connection, bool is_again, const std::function<void()>& commit)
      : connection_(connection), is_again_(is_again), commit_(commit) {}

  SqlConnection* operator->() const { return &connection_; }
  SqlConnection& connection() const { return connection_; }

  // The same was asked for before, and it is not known what became of that.
  bool is_again() const { return is_again_; }

  void commit() { commit_(); }

 private:
  SqlConnection& connection_;
  const bool is_again_;
  const std::function<void()>& commit_;
};

// What a transaction is to the disk.
enum class Change {
  kNew,         // refused where there is no room
  kNeeded,      // frees room, or has to be kept whatever the disk is like
  kRepeatable,  // the same, and it may be lost with the power: it is made again without harm
};

// The records that stores share. Thread safe. All may throw Error kOutOfSpace, kUnavailable or
// kInternal.
class SqlDatabase {
 public:
  virtual ~SqlDatabase() = default;

  // Runs `act(transaction)`, which commits or changes nothing. It may be run more than once.
  template <class Act>
  auto change(Change kind, const Act& act) {
    return result_of<SqlTransaction>(
        act, [&](const std::function<void(SqlTransaction&)>& run) { in_transaction(kind, run); });
  }
  // One statement; returns how many rows it changed.
  template <class... Values>
  std::size_t run(Change kind, std::string_view sql, const Values&... values) {
    const std::array<Parameter, sizeof...(Values)> parameters{Parameter(values)...};
    return tell(kind, sql, parameters);
  }

  // Runs `act(connection)`, which only reads. It may be run more than once.
  template <class Act>
  auto read(const Act& act) {
    return result_of<SqlConnection>(
        act, [&](const std::function<void(SqlConnection&)>& run) { while_reading(run); });
  }
  // One statement. Its rows hold nothing that others wait for.
  template <class... Values>
  Rows query(std::string_view sql, const Values&... values) {
    const std::array<Parameter, sizeof...(Values)> parameters{Parameter(values)...};
    return ask(sql, parameters);
  }

  // The tables' time of one by this machine's clock, and back.
  virtual std::int64_t to_us(Time time) const = 0;
  virtual Time from_us(std::int64_t us) const = 0;

  // How many records one transaction may remove: one where others wait for it.
  virtual std::size_t most_at_once() const = 0;

 protected:
  virtual void in_transaction(Change kind, const std::function<void(SqlTransaction&)>& act) = 0;
  virtual void while_reading(const std::function<void(SqlConnection&)>& act) = 0;
  virtual std::size_t tell(Change kind, std::string_view sql,
                           std::span<const Parameter> parameters) = 0;
  virtual Rows ask(std::string_view sql, std::span<const Parameter> parameters) = 0;

 private:
  template <class Argument, class Act, class Run>
  static auto result_of(const Act& act, const Run& run) {
    using Result = std::invoke_result_t<const Act&, Argument&>;
    if constexpr (std::is_void_v<Result>) {
      run(act);
    } else {
      std::optional<Result> result;
      run([&](Argument& argument) { result.emplace(act(argument)); });
      return *std::move(result);
    }
  }
};

}  // namespace isomesh::store
