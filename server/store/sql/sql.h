// SQL for all engines: one text for each statement, and interfaces for the differences. For stores
// only.
//
// Parameters are ?1, ?2 and so on. Numbers of states have names, such as {job.queued}: see names.h.
// `isomesh_now()` is the current time in the tables' form: microseconds since 1970.
// `isomesh_kept(time)` is used for times that decide how long something is kept: it is that time,
// or the newest certain time if the clock has gone back.
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

#include "proto/types.h"
#include "server/store/expiry.h"

namespace isomesh::store {

// The value of a parameter. A text must outlive it. The type is known even if the value is NULL.
struct Parameter {
  enum class Type {
    kInteger,
    kReal,
    kText,
    kOfColumn,  // a text, converted to the type of the column it is used with
  };

  template <class T>
  requires std::is_integral_v<T> || std::is_enum_v<T>
  explicit Parameter(T value) : integer(static_cast<std::int64_t>(value)) {}
  explicit Parameter(Stage value) : Parameter(to_string(value)) {}
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

// The result of a statement. Not thread safe.
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

  // Advances to the next row; returns false after the last.
  bool next() { return source_->next(); }

  bool is_null(int column) const { return source_->is_null(column); }
  std::int64_t integer(int column) const { return source_->integer(column); }
  bool boolean(int column) const { return integer(column) != 0; }
  std::size_t count(int column) const { return static_cast<std::size_t>(integer(column)); }
  double real(int column) const { return source_->real(column); }
  std::string text(int column) const { return source_->text(column); }
  // The number of an enumerator from 0 to `last`; a damaged number is taken for `last`.
  template <class Enum>
  Enum choice(int column, Enum last) const {
    const std::int64_t number = integer(column);
    const bool is_known = number >= 0 && number < static_cast<std::int64_t>(last);
    return is_known ? static_cast<Enum>(number) : last;
  }

  // By its name; a damaged one is taken for the last.
  Stage stage(int column) const {
    return from_string<Stage>(source_->text(column)).value_or(Stage::kDone);
  }

 private:
  std::unique_ptr<Source> source_;
};

// One connection. Caches prepared statements.
class SqlConnection {
 public:
  virtual ~SqlConnection() = default;

  // The same text may be in use once at a time. Destroy the rows before the transaction commits.
  virtual Rows ask(std::string_view sql, std::span<const Parameter> parameters) = 0;
  // Runs a statement to its end; returns the number of changed rows.
  virtual std::size_t tell(std::string_view sql, std::span<const Parameter> parameters) = 0;

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

  // Runs several statements without parameters.
  virtual void script(const std::string& sql) = 0;

  virtual bool has_table(const std::string& name) = 0;
  // The type of a text that is a key, in a script that creates tables.
  virtual const char* key_type() const = 0;
  // The end of a table that is stored by its primary key.
  virtual const char* end_of_keyed_table() const = 0;

  // The end of a SELECT whose rows the transaction may change, so that no other transaction changes
  // them meanwhile: " FOR UPDATE" if there may be others.
  virtual const char* for_update() const = 0;
  // Prevents other changes of the table until the transaction ends.
  virtual void lock_table(const std::string& name) = 0;
};

// A transaction. Rolled back on destruction unless committed.
class SqlTransaction {
 public:
  SqlTransaction(SqlConnection& connection, bool is_again, const std::function<void()>& commit)
      : connection_(connection), is_again_(is_again), commit_(commit) {}

  SqlConnection* operator->() const { return &connection_; }
  SqlConnection& connection() const { return connection_; }

  // True if this repeats a transaction with unknown outcome.
  bool is_again() const { return is_again_; }

  void commit() { commit_(); }

 private:
  SqlConnection& connection_;
  const bool is_again_;
  const std::function<void()>& commit_;
};

// Importance of a transaction if the disk is full.
enum class Change {
  kNew,         // rejected if there is no space
  kNeeded,      // frees space, or must be stored in any case
  kRepeatable,  // as kNeeded, but a power failure may lose it: repeating it does no harm
};

// The database of all stores. Thread safe. All methods may throw Error kOutOfSpace, kUnavailable or
// kInternal.
class SqlDatabase {
 public:
  virtual ~SqlDatabase() = default;

  // Runs `act(transaction)`, which commits or changes nothing. `act` may run more than once.
  template <class Act>
  auto change(Change kind, const Act& act) {
    return result_of<SqlTransaction>(
        act, [&](const std::function<void(SqlTransaction&)>& run) { in_transaction(kind, run); });
  }
  // Runs one statement; returns the number of changed rows.
  template <class... Values>
  std::size_t run(Change kind, std::string_view sql, const Values&... values) {
    const std::array<Parameter, sizeof...(Values)> parameters{Parameter(values)...};
    return tell(kind, sql, parameters);
  }

  // Runs `act(connection)`, which only reads. `act` may run more than once.
  template <class Act>
  auto read(const Act& act) {
    return result_of<SqlConnection>(
        act, [&](const std::function<void(SqlConnection&)>& run) { while_reading(run); });
  }
  // Runs one query. Its rows block nobody.
  template <class... Values>
  Rows query(std::string_view sql, const Values&... values) {
    const std::array<Parameter, sizeof...(Values)> parameters{Parameter(values)...};
    return ask(sql, parameters);
  }

  // Converts between this machine's clock and the tables' time.
  virtual std::int64_t to_us(Time time) const = 0;
  virtual Time from_us(std::int64_t us) const = 0;

  // Limit of records that one transaction removes: one if others wait for it.
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
