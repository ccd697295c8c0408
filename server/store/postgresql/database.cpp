#include "server/store/postgresql/database.h"

#include <cstdlib>
#include <limits>
#include <thread>

#include "base/ids.h"
#include "proto/error.h"
#include "server/store/microseconds.h"
#include "server/store/postgresql/schema.h"

namespace isomesh::store::postgresql {
namespace {

constexpr std::chrono::milliseconds kBetweenQuestions{50};
// Nodes that ended longer ago and have no runs are removed.
constexpr std::int64_t kNodesKeptUs = std::int64_t{7 * 24 * 3600} * 1'000'000;

std::string random_uuid() {
  const std::string hex = random_hex(16);
  return hex.substr(0, 8) + '-' + hex.substr(8, 4) + "-4" + hex.substr(13, 3) + "-a" +
         hex.substr(17, 3) + '-' + hex.substr(20, 12);
}

constexpr std::int64_t kToleranceUs = 1'000'000;

std::int64_t steady_us() {
  const auto since_start = std::chrono::steady_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::microseconds>(since_start).count();
}

// Names have any characters, and the server would reject those that its encoding lacks. SQL_ASCII
// stores bytes as they are.
void check_encoding(Connection& connection) {
  Rows row = connection.query("SELECT current_setting('server_encoding')");
  row.next();
  const std::string encoding = row.text(0);
  if (encoding == "UTF8" || encoding == "SQL_ASCII") return;
  throw Error(ErrorCode::kUnavailable,
              "the database of --store has the encoding " + encoding +
                  ", which lacks characters of names: create one with UTF8 (createdb --encoding "
                  "UTF8 --template template0), and name it with --store");
}

// Runs `act`; if it cannot connect, throws Error kUnavailable with the reason for the operator.
template <class Act>
auto with_reason(const std::string& url, const Act& act) {
  try {
    return act();
  } catch (const Interrupted&) {
    const std::string reason = reason_of_no_connection(url);
    if (reason.empty()) throw;
    throw Error(ErrorCode::kUnavailable, "the database of --store cannot be used: " + reason);
  }
}

// Number of connections that this thread holds, of any database.
thread_local int borrowed = 0;

}  // namespace

Database::Database(DatabaseOptions options)
    : options_(std::move(options)),
      schemas_(schemas_with(options_.components)),
      node_(random_uuid()) {
  with_reason(options_.url, [&] {
    ask([&](Connection& connection, bool) {
      check_encoding(connection);
      upgrade(connection, schemas_);
    });
  });
  ask([&](Connection& connection, bool) {
    connection.run("INSERT INTO nodes VALUES(?1::uuid, ?2, isomesh_now()) ON CONFLICT DO NOTHING",
                   node_, options_.node);
    connection.run(
        "DELETE FROM nodes n WHERE since < isomesh_now() - ?1 AND EXISTS (SELECT 1 FROM "
        "nodes m WHERE m.name = n.name AND m.since > n.since) AND NOT EXISTS (SELECT 1 FROM runs r "
        "WHERE r.node = n.id)",
        kNodesKeptUs);
  });
}

bool Database::responds() {
  try {
    const Borrowed borrowed(*this, std::chrono::steady_clock::now() + options_.patience);
    borrowed.connection().query("SELECT 1");
    return true;
  } catch (const Error&) {
    return false;
  }
}

std::int64_t Database::now_us() const { return steady_us() + beyond_steady_us_; }

std::int64_t Database::shift() const {
  const std::int64_t now = now_us() - store::to_us(std::chrono::system_clock::now());
  if (std::abs(now - shift_us_) > kToleranceUs) shift_us_ = now;
  return shift_us_;
}

std::int64_t Database::to_us(Time time) const { return store::to_us(time) + shift(); }

Time Database::from_us(std::int64_t us) const {
  return store::from_us(store::to_us(store::from_us(us)) - shift());
}

std::chrono::steady_clock::time_point Database::steady_of(std::int64_t us) const {
  return std::chrono::steady_clock::time_point(std::chrono::microseconds(us - beyond_steady_us_));
}

// The measurement with the shortest round trip is the most accurate of several. The database's time
// is taken as that at the start of the request, so that times it has written are never in the
// future.
void Database::look_at_clock(Connection& connection) {
  constexpr std::int64_t kQuickUs = 5000;
  std::int64_t quickest = std::numeric_limits<std::int64_t>::max();
  std::int64_t beyond = 0;
  for (int tries = 0; tries < 5 && quickest > kQuickUs; ++tries) {
    const std::int64_t asked = steady_us();
    Rows row = connection.query("SELECT (extract(epoch FROM clock_timestamp()) * 1000000)::bigint");
    row.next();
    const std::int64_t took = steady_us() - asked;
    if (took >= quickest) continue;
    quickest = took;
    beyond = row.integer(0) - asked;
  }
  if (std::abs(beyond - beyond_steady_us_) > kToleranceUs) beyond_steady_us_ = beyond;
}

void Database::in_transaction(Change, const std::function<void(SqlTransaction&)>& act) {
  ask([&](Connection& connection, bool is_again) {
    Transaction transaction(connection);
    const std::function<void()> commit = [&] { transaction.commit(); };
    SqlTransaction shown(connection, is_again, commit);
    act(shown);
  });
}

void Database::while_reading(const std::function<void(SqlConnection&)>& act) {
  ask([&](Connection& connection, bool) { act(connection); });
}

std::size_t Database::tell(Change, std::string_view sql, std::span<const Parameter> parameters) {
  return ask([&](Connection& connection, bool) { return connection.tell(sql, parameters); });
}

Rows Database::ask(std::string_view sql, std::span<const Parameter> parameters) {
  return ask([&](Connection& connection, bool) { return connection.ask(sql, parameters); });
}

std::unique_ptr<Connection> Database::take(std::chrono::steady_clock::time_point deadline) {
  {
    // A thread that holds a connection does not wait for another one; otherwise all threads might
    // wait for each other.
    const bool waits = borrowed == 0;
    Lock lock(mutex_);
    const bool has_one = given_.wait_until(lock, deadline, [&]() ISOMESH_REQUIRES(mutex_) {
      return !waits || !idle_.empty() || open_ < options_.connections;
    });
    if (!has_one) throw Interrupted(ErrorCode::kUnavailable, "the database does not respond");
    ++borrowed;
    if (!idle_.empty()) {
      auto connection = std::move(idle_.back());
      idle_.pop_back();
      connection->wait_until(deadline);
      return connection;
    }
    ++open_;
  }
  try {
    auto connection = std::make_unique<Connection>(options_.url, deadline);
    look_at_clock(*connection);
    return connection;
  } catch (...) {
    give(nullptr);
    throw;
  }
}

// If one connection is lost, the others most likely are too.
void Database::give(std::unique_ptr<Connection> connection) {
  --borrowed;
  const Lock lock(mutex_);
  if (connection && connection->is_open()) {
    idle_.push_back(std::move(connection));
  } else {
    open_ -= 1 + idle_.size();
    idle_.clear();
  }
  given_.notify_all();
}

void Database::pause() { std::this_thread::sleep_for(kBetweenQuestions); }

std::unique_ptr<Connection> connect_to_trail(const std::string& url,
                                             const std::vector<Schema>& components) {
  return with_reason(url, [&] {
    auto connection = std::make_unique<Connection>(url);
    if (!connection->has_table("audit")) {
      throw Error(ErrorCode::kNotFound, "the database has no data of isomeshd");
    }
    check_versions(*connection, components);
    connection->wait_until(Connection::Clock::time_point::max());  // it has many responses
    return connection;
  });
}

}  // namespace isomesh::store::postgresql
