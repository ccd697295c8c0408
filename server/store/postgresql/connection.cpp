#include "server/store/postgresql/connection.h"

#include <array>
#include <cstdlib>
#include <memory>
#include <utility>

#include <libpq-fe.h>

#include "base/text.h"
#include "proto/error.h"

namespace isomesh::store::postgresql {
namespace {

// What a statement may take: far more than any of ours does, so that one that hangs does not keep
// its connection for ever. Locks are held for milliseconds.
constexpr const char* kSession =
    "SET statement_timeout = '60s'; SET lock_timeout = '10s'; "
    "SET idle_in_transaction_session_timeout = '60s'; SET bytea_output = 'hex'";

// Of what the other side has said, only its own words: they hold neither addresses nor passwords.
std::string message_of(const PGresult* result) {
  const char* text = PQresultErrorField(result, PG_DIAG_MESSAGE_PRIMARY);
  const char* state = PQresultErrorField(result, PG_DIAG_SQLSTATE);
  return std::string("the database: ") + (text == nullptr ? "no response" : text) + " (" +
         (state == nullptr ? "-" : state) + ")";
}

// By the code's class (PostgreSQL, appendix A).
[[noreturn]] void throw_error(const PGresult* result) {
  const char* code = PQresultErrorField(result, PG_DIAG_SQLSTATE);
  const std::string_view state = code == nullptr ? "" : code;
  const std::string text = message_of(result);
  if (state == "53100") {
    throw Error(ErrorCode::kOutOfSpace, "the database has no space left");
  }
  // Another transaction came first; or it ends, starts, or has become a standby.
  for (const std::string_view passing :
       {"40001", "40P01", "55P03", "57P01", "57P02", "57P03", "25006"}) {
    if (state == passing) throw Interrupted(ErrorCode::kUnavailable, text);
  }
  if (state.starts_with("08") || state.empty()) throw Interrupted(ErrorCode::kUnavailable, text);
  if (state.starts_with("53") || state == "57014") throw Error(ErrorCode::kUnavailable, text);
  throw Error(ErrorCode::kInternal, text);
}

template <class T, class Append>
Parameter array_of(const std::vector<T>& values, const Append& append) {
  std::string text = "{";
  for (const T& value : values) {
    if (text.size() > 1) text += ',';
    append(text, value);
  }
  return text + '}';
}

}  // namespace

Parameter parameter(double value) {
  std::array<char, 32> text = {};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  return std::string(text.data(), end);
}

Parameter parameter(const std::vector<std::string>& values) {
  return array_of(values, [](std::string& text, const std::string& value) {
    text += '"';
    for (const char letter : value) {
      if (letter == '"' || letter == '\\') text += '\\';
      text += letter;
    }
    text += '"';
  });
}

Parameter parameter(const std::vector<std::int64_t>& values) {
  return array_of(values,
                  [](std::string& text, std::int64_t value) { text += std::to_string(value); });
}

Parameter parameter(const std::vector<double>& values) {
  return array_of(values, [](std::string& text, double value) { text += *parameter(value); });
}

void Rows::Clear::operator()(pg_result* result) const { PQclear(result); }

Rows::Rows(pg_result* result) : result_(result), count_(PQntuples(result)) {}

bool Rows::is_null(int column) const { return PQgetisnull(result_.get(), row_, column) != 0; }

std::string_view Rows::raw(int column) const {
  return {PQgetvalue(result_.get(), row_, column),
          static_cast<std::size_t>(PQgetlength(result_.get(), row_, column))};
}

std::int64_t Rows::integer(int column) const {
  const std::string_view text = raw(column);
  std::int64_t value = 0;
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

bool Rows::boolean(int column) const { return raw(column) == "t"; }

double Rows::real(int column) const {
  const std::string_view text = raw(column);
  double value = 0;
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

std::string Rows::text(int column) const { return std::string(raw(column)); }

std::vector<double> Rows::reals(int column) const {
  std::vector<double> values;
  std::string_view text = raw(column);
  while (text.size() > 1) {
    text.remove_prefix(1);  // the brace or a comma
    double value = 0;
    const auto end = std::from_chars(text.data(), text.data() + text.size(), value).ptr;
    values.push_back(value);
    text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  }
  return values;
}

std::size_t Rows::changed() const {
  return static_cast<std::size_t>(std::strtoull(PQcmdTuples(result_.get()), nullptr, 10));
}

void check_url(const std::string& url) {
  const auto refuse = [](const std::string& why) { throw invalid_parameter("store", why); };
  if (!url.starts_with("postgresql://") && !url.starts_with("postgres://")) {
    refuse("must be a URL that begins with postgresql://");
  }
  char* complaint = nullptr;
  const std::unique_ptr<PQconninfoOption, decltype(&PQconninfoFree)> parts(
      PQconninfoParse(url.c_str(), &complaint), &PQconninfoFree);
  PQfreemem(complaint);  // it repeats what it complains of
  if (!parts) refuse("is not a valid PostgreSQL URL");
  for (const PQconninfoOption* part = parts.get(); part->keyword != nullptr; ++part) {
    const std::string_view name = part->keyword;
    const bool is_secret = name == "password" || name == "sslpassword";
    if (is_secret && part->val != nullptr) {
      refuse(
          "must not contain a password: put it into a password file and set PGPASSFILE to its "
          "name");
    }
  }
}

namespace {

// To be finished by the caller, also where it has failed.
pg_conn* connected(const std::string& url) {
  // What the URL says comes later and wins.
  const std::array<const char*, 9> names = {
      "connect_timeout",      "tcp_user_timeout", "keepalives_idle", "fallback_application_name",
      "target_session_attrs", "dbname",           "client_encoding", nullptr};
  const std::array<const char*, 9> values = {"5",          "10000",     "10",   "isomeshd",
                                             "read-write", url.c_str(), "UTF8", nullptr};
  return PQconnectdbParams(names.data(), values.data(), 1);
}

}  // namespace

std::string reason_of_no_connection(const std::string& url) {
  const std::unique_ptr<pg_conn, decltype(&PQfinish)> handle(connected(url), &PQfinish);
  if (PQstatus(handle.get()) == CONNECTION_OK) return "";
  // A line for each address that was tried.
  std::string reason;
  for (const std::string_view line : split(PQerrorMessage(handle.get()), '\n')) {
    if (!line.empty()) reason += (reason.empty() ? "" : "; ") + std::string(trimmed(line));
  }
  return reason;
}

Connection::Connection(const std::string& url) : handle_(connected(url)) {
  if (PQstatus(handle_) != CONNECTION_OK) {
    // libpq's own text may name hosts, users and files, and this one goes to clients.
    PQfinish(handle_);
    throw Interrupted(ErrorCode::kUnavailable, "the database does not respond");
  }
  PQsetNoticeReceiver(handle_, take_notice, this);
  try {
    script(kSession);
  } catch (...) {
    PQfinish(handle_);
    throw;
  }
}

// A commit whose wait for the synchronous standby was cut short is told as done, with a warning.
void Connection::take_notice(void* connection, const pg_result* notice) {
  const char* state = PQresultErrorField(notice, PG_DIAG_SQLSTATE);
  const char* severity = PQresultErrorField(notice, PG_DIAG_SEVERITY_NONLOCALIZED);
  const bool is_warning = severity != nullptr && std::string_view(severity) == "WARNING";
  if (is_warning && state != nullptr && std::string_view(state) == "01000") {
    static_cast<Connection*>(connection)->is_warned_ = true;
  }
}

Connection::~Connection() { PQfinish(handle_); }

bool Connection::is_open() const { return PQstatus(handle_) == CONNECTION_OK; }

int Connection::socket() const { return PQsocket(handle_); }

void Connection::script(const std::string& sql) { checked(PQexec(handle_, sql.c_str())); }

std::vector<std::string> Connection::take_messages() {
  if (PQconsumeInput(handle_) == 0) {
    throw Interrupted(ErrorCode::kUnavailable, "the database does not respond");
  }
  std::vector<std::string> messages;
  while (PGnotify* message = PQnotifies(handle_)) {
    if (message->be_pid != PQbackendPID(handle_)) messages.emplace_back(message->extra);
    PQfreemem(message);
  }
  return messages;
}

Rows Connection::execute(std::string_view sql, const std::vector<Parameter>& parameters) {
  const std::string& name = prepared(sql);
  std::vector<const char*> texts;
  texts.reserve(parameters.size());
  for (const Parameter& each : parameters) texts.push_back(each ? each->c_str() : nullptr);
  return checked(PQexecPrepared(handle_, name.c_str(), static_cast<int>(texts.size()), texts.data(),
                                nullptr, nullptr, 0));
}

const std::string& Connection::prepared(std::string_view sql) {
  const std::string text(sql);
  const auto known = names_.find(text);
  if (known != names_.end()) return known->second;
  const std::string name = "s" + std::to_string(names_.size());
  checked(PQprepare(handle_, name.c_str(), text.c_str(), 0, nullptr));
  return names_[text] = name;
}

Rows Connection::checked(pg_result* result) {
  Rows rows(result);
  const ExecStatusType status = PQresultStatus(result);
  if (std::exchange(is_warned_, false)) {
    throw Interrupted(ErrorCode::kUnavailable, "the database's standby does not respond");
  }
  if (status == PGRES_TUPLES_OK || status == PGRES_COMMAND_OK) return rows;
  if (!is_open()) {
    throw Interrupted(ErrorCode::kUnavailable, "the database does not respond");
  }
  throw_error(result);
}

Transaction::~Transaction() {
  if (!is_open_ || !connection_.is_open()) return;
  try {
    connection_.run("ROLLBACK");
  } catch (const Error&) {
    // Lost, and with it the transaction.
    return;
  }
}

void Transaction::commit() {
  connection_.run("COMMIT");
  is_open_ = false;
}

}  // namespace isomesh::store::postgresql
