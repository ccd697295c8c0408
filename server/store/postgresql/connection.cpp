#include "server/store/postgresql/connection.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <new>
#include <utility>

#include <libpq-fe.h>
#include <poll.h>

#include "base/text.h"
#include "proto/error.h"
#include "proto/json_tree.h"
#include "server/store/sql/names.h"

namespace isomesh::store::postgresql {
namespace {

// Limits far above what our statements need, so that a hanging statement does not occupy its
// connection forever. Locks are held for milliseconds.
constexpr const char* kSession =
    "SET statement_timeout = '60s'; SET lock_timeout = '4s'; "
    "SET idle_in_transaction_session_timeout = '60s'; SET bytea_output = 'hex'";

// Only the primary message and the SQLSTATE: they contain neither addresses nor passwords.
std::string message_of(const PGresult* result) {
  const char* text = PQresultErrorField(result, PG_DIAG_MESSAGE_PRIMARY);
  const char* state = PQresultErrorField(result, PG_DIAG_SQLSTATE);
  return std::string("the database: ") + (text == nullptr ? "no response" : text) + " (" +
         (state == nullptr ? "-" : state) + ")";
}

// By SQLSTATE and its class (PostgreSQL documentation, appendix A).
[[noreturn]] void throw_error(const PGresult* result) {
  const char* code = PQresultErrorField(result, PG_DIAG_SQLSTATE);
  const std::string_view state = code == nullptr ? "" : code;
  const std::string text = message_of(result);
  if (state == "53100") {
    throw Error(ErrorCode::kOutOfSpace, "the database has no space left");
  }
  // Conflicts with another transaction; or the server is stopping, starting, or has become a
  // standby.
  for (const std::string_view passing :
       {"40001", "40P01", "55P03", "57P01", "57P02", "57P03", "25006"}) {
    if (state == passing) throw Interrupted(ErrorCode::kUnavailable, text);
  }
  if (state.starts_with("08") || state.empty()) throw Interrupted(ErrorCode::kUnavailable, text);
  if (state.starts_with("53") || state == "57014") throw Error(ErrorCode::kUnavailable, text);
  throw Error(ErrorCode::kInternal, text);
}

// Object identifiers of types in PostgreSQL's system catalogue.
Oid type_of(const Parameter& parameter) {
  constexpr Oid kBigint = 20;
  constexpr Oid kText = 25;
  constexpr Oid kDouble = 701;
  switch (parameter.type) {
    case Parameter::Type::kInteger:
      return kBigint;
    case Parameter::Type::kReal:
      return kDouble;
    case Parameter::Type::kText:
      return kText;
    case Parameter::Type::kOfColumn:
      break;
  }
  return 0;
}

// A text of PostgreSQL is UTF-8 and has no NUL byte. Requests may name other texts, which no record
// has. U+FFFD in their place finds none, where a NUL byte would end the text before it.
std::string storable(std::string_view text) {
  const auto is_plain = [](unsigned char c) { return c > 0 && c < 0x80; };
  if (std::ranges::all_of(text, is_plain)) return std::string(text);
  std::string valid = valid_utf8(text);
  constexpr std::string_view kReplacement = "\xEF\xBF\xBD";
  for (std::size_t at = valid.find('\0'); at != std::string::npos; at = valid.find('\0', at)) {
    valid.replace(at, 1, kReplacement);
  }
  return valid;
}

std::string text_of(const Parameter& parameter) {
  if (parameter.type == Parameter::Type::kInteger) return std::to_string(parameter.integer);
  if (parameter.type != Parameter::Type::kReal) return storable(parameter.text);
  std::array<char, 32> text = {};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), parameter.real).ptr;
  return {text.data(), end};
}

// As PostgreSQL has it: $1 instead of ?1, and numbers instead of names.
std::string in_dialect(std::string_view sql) {
  std::string text = with_numbers(sql);
  std::ranges::replace(text, '?', '$');
  return text;
}

template <class T>
T number_of(std::string_view text) {
  T value = 0;
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

}  // namespace

class Connection::ResultRows : public Rows::Source {
 public:
  explicit ResultRows(Result result) : result_(std::move(result)) {}

  bool next() override { return ++row_ < PQntuples(result_.get()); }
  bool is_null(int column) const override { return PQgetisnull(result_.get(), row_, column) != 0; }
  std::int64_t integer(int column) const override {
    return raw(column) == "t" ? 1 : number_of<std::int64_t>(raw(column));
  }
  double real(int column) const override { return number_of<double>(raw(column)); }
  std::string text(int column) const override { return std::string(raw(column)); }

 private:
  std::string_view raw(int column) const {
    return {PQgetvalue(result_.get(), row_, column),
            static_cast<std::size_t>(PQgetlength(result_.get(), row_, column))};
  }

  Result result_;
  int row_ = -1;
};

void Connection::Clear::operator()(pg_result* result) const { PQclear(result); }

namespace {

using UrlParts = std::unique_ptr<PQconninfoOption, decltype(&PQconninfoFree)>;

// Null if the URL is invalid.
UrlParts parts_of(const std::string& url) {
  char* complaint = nullptr;
  UrlParts parts(PQconninfoParse(url.c_str(), &complaint), &PQconninfoFree);
  PQfreemem(complaint);  // the message repeats the URL
  return parts;
}

}  // namespace

std::vector<std::pair<std::string, std::filesystem::path>> files_of_url(const std::string& url) {
  constexpr std::array kFiles = {"sslrootcert", "sslcert", "sslkey", "sslcrl", "passfile"};
  std::vector<std::pair<std::string, std::filesystem::path>> files;
  const UrlParts parts = parts_of(url);
  if (!parts) return files;
  for (const PQconninfoOption* part = parts.get(); part->keyword != nullptr; ++part) {
    if (std::ranges::find(kFiles, std::string_view(part->keyword)) == kFiles.end()) continue;
    const char* file = part->val;
    if (file == nullptr && part->envvar != nullptr) file = std::getenv(part->envvar);
    const std::string_view name = file == nullptr ? "" : file;
    // The system's authorities and a key in an OpenSSL engine are not files.
    const bool is_file = !name.empty() && name != "system" &&
                         (name.find(':') == std::string_view::npos || name.starts_with('/'));
    if (is_file) files.emplace_back(part->keyword, file);
  }
  return files;
}

void check_url(const std::string& url) {
  const auto refuse = [](const std::string& why) { throw invalid_parameter("store", why); };
  if (!url.starts_with("postgresql://") && !url.starts_with("postgres://")) {
    refuse("must be a URL that begins with postgresql://");
  }
  const UrlParts parts = parts_of(url);
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

// Waits until the socket is readable or writable. Returns false if it is not at the deadline.
bool waits_for(int socket, short events, Connection::Clock::time_point deadline) {
  while (true) {
    const auto left =
        std::chrono::ceil<std::chrono::milliseconds>(deadline - Connection::Clock::now());
    pollfd watched = {socket, events, 0};
    const int count =
        ::poll(&watched, 1, static_cast<int>(std::clamp<std::int64_t>(left.count(), 0, 60'000)));
    if (count > 0) return true;
    if (count == 0 && left.count() <= 0) return false;
    if (count < 0 && errno != EINTR) return false;
  }
}

// Connects by the deadline. The caller must call PQfinish, also after a failure. libpq's own
// timeout applies per address, and the URL may set another one, so the deadline is enforced here.
pg_conn* connected(const std::string& url, Connection::Clock::time_point deadline) {
  // Parameters in the URL override those before "dbname".
  const std::array<const char*, 7> names = {"tcp_user_timeout",
                                            "keepalives_idle",
                                            "fallback_application_name",
                                            "target_session_attrs",
                                            "dbname",
                                            "client_encoding",
                                            nullptr};
  const std::array<const char*, 7> values = {"10000",     "10",   "isomeshd", "read-write",
                                             url.c_str(), "UTF8", nullptr};
  pg_conn* handle = PQconnectStartParams(names.data(), values.data(), 1);
  if (handle == nullptr) throw std::bad_alloc();
  if (PQstatus(handle) == CONNECTION_BAD) return handle;
  for (PostgresPollingStatusType next = PGRES_POLLING_WRITING;
       next != PGRES_POLLING_OK && next != PGRES_POLLING_FAILED; next = PQconnectPoll(handle)) {
    const short events = next == PGRES_POLLING_READING ? POLLIN : POLLOUT;
    if (!waits_for(PQsocket(handle), events, deadline)) break;
  }
  return handle;
}

}  // namespace

std::string reason_of_no_connection(const std::string& url) {
  const std::unique_ptr<pg_conn, decltype(&PQfinish)> handle(
      connected(url, Connection::Clock::now() + Connection::kPatience), &PQfinish);
  if (PQstatus(handle.get()) == CONNECTION_OK) return "";
  // One line per address that was tried.
  std::string reason;
  for (const std::string_view line : split(PQerrorMessage(handle.get()), '\n')) {
    if (!line.empty()) reason += (reason.empty() ? "" : "; ") + std::string(trimmed(line));
  }
  return reason.empty() ? "no response" : reason;
}

Connection::Connection(const std::string& url, Clock::time_point deadline)
    : handle_(connected(url, deadline)), deadline_(deadline) {
  if (PQstatus(handle_) != CONNECTION_OK) {
    // The text of libpq may name hosts, users and files, and clients see this one.
    PQfinish(handle_);
    throw Interrupted(ErrorCode::kUnavailable, "the database does not respond");
  }
  PQsetNoticeReceiver(handle_, take_notice, this);
  try {
    PQsetnonblocking(handle_, 1);
    script(kSession);
  } catch (...) {
    PQfinish(handle_);
    throw;
  }
}

// PostgreSQL reports a commit as successful, with a warning, if its wait for the synchronous
// standby was interrupted.
void Connection::take_notice(void* connection, const pg_result* notice) {
  const char* state = PQresultErrorField(notice, PG_DIAG_SQLSTATE);
  const char* severity = PQresultErrorField(notice, PG_DIAG_SEVERITY_NONLOCALIZED);
  const bool is_warning = severity != nullptr && std::string_view(severity) == "WARNING";
  if (is_warning && state != nullptr && std::string_view(state) == "01000") {
    static_cast<Connection*>(connection)->is_warned_ = true;
  }
}

Connection::~Connection() { PQfinish(handle_); }

bool Connection::is_open() const { return !is_given_up_ && PQstatus(handle_) == CONNECTION_OK; }

int Connection::socket() const { return PQsocket(handle_); }

void Connection::script(const std::string& sql) {
  checked(result_of(PQsendQuery(handle_, with_numbers(sql).c_str()) == 1));
}

bool Connection::has_table(const std::string& name) {
  return query("SELECT 1 WHERE to_regclass(?1) IS NOT NULL", name).next();
}

void Connection::wait_for(short events) {
  if (waits_for(PQsocket(handle_), events, deadline_)) return;
  is_given_up_ = true;
  throw Interrupted(ErrorCode::kUnavailable, "the database does not respond");
}

// Returns the last result of a query; null if the connection is lost.
pg_result* Connection::result_of(bool is_asked) {
  if (!is_asked) return nullptr;
  for (int left = PQflush(handle_); left != 0; left = PQflush(handle_)) {
    if (left < 0) return nullptr;
    wait_for(POLLIN | POLLOUT);
    if (PQconsumeInput(handle_) == 0) return nullptr;
  }
  Result last;
  while (true) {
    while (PQisBusy(handle_) == 1) {
      wait_for(POLLIN);
      if (PQconsumeInput(handle_) == 0) break;  // PQgetResult reports the failure
    }
    Result result(PQgetResult(handle_));
    if (!result) return last.release();
    last = std::move(result);
  }
}

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

Rows Connection::ask(std::string_view sql, std::span<const Parameter> parameters) {
  return Rows(std::make_unique<ResultRows>(execute(sql, parameters)));
}

std::size_t Connection::tell(std::string_view sql, std::span<const Parameter> parameters) {
  const Result result = execute(sql, parameters);
  return number_of<std::size_t>(PQcmdTuples(result.get()));
}

void Connection::lock_table(const std::string& name) {
  script("LOCK TABLE " + name + " IN SHARE ROW EXCLUSIVE MODE");
}

Connection::Result Connection::execute(std::string_view sql,
                                       std::span<const Parameter> parameters) {
  const std::string& name = prepared(sql, parameters);
  std::vector<std::string> texts;
  std::vector<const char*> values;
  texts.reserve(parameters.size());
  for (const Parameter& each : parameters) {
    texts.push_back(text_of(each));
    values.push_back(each.is_null ? nullptr : texts.back().c_str());
  }
  return checked(
      result_of(PQsendQueryPrepared(handle_, name.c_str(), static_cast<int>(values.size()),
                                    values.data(), nullptr, nullptr, 0) == 1));
}

const std::string& Connection::prepared(std::string_view sql,
                                        std::span<const Parameter> parameters) {
  const std::string text(sql);
  const auto known = names_.find(text);
  if (known != names_.end()) return known->second;
  std::vector<Oid> types;
  for (const Parameter& each : parameters) types.push_back(type_of(each));
  const std::string name = "s" + std::to_string(names_.size());
  checked(result_of(PQsendPrepare(handle_, name.c_str(), in_dialect(sql).c_str(),
                                  static_cast<int>(types.size()), types.data()) == 1));
  return names_[text] = name;
}

Connection::Result Connection::checked(pg_result* result) {
  Result owned(result);
  const ExecStatusType status = PQresultStatus(result);
  if (std::exchange(is_warned_, false)) {
    throw Interrupted(ErrorCode::kUnavailable, "the database's standby does not respond");
  }
  if (status == PGRES_TUPLES_OK || status == PGRES_COMMAND_OK) return owned;
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
    // The connection is lost, and its transaction with it.
    return;
  }
}

void Transaction::commit() {
  connection_.run("COMMIT");
  is_open_ = false;
}

}  // namespace isomesh::store::postgresql
