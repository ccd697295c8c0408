#include "server/store/sqlite/identity.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <string_view>

#include "base/ids.h"
#include "base/log.h"
#include "proto/error.h"
#include "server/store/sql/trusted_clock.h"

namespace isomesh::store {
namespace {

// Interval of marks while nothing is stored.
constexpr std::chrono::minutes kBetweenIdleMarks{10};
// In place of the number of a mark.
constexpr std::int64_t kMoved = -1;

bool has_records(Connection& connection) {
  Rows query = connection.query(
      "SELECT EXISTS(SELECT 1 FROM volumes) OR EXISTS(SELECT 1 FROM jobs) OR EXISTS(SELECT 1 FROM "
      "expired)");
  query.next();
  return query.integer(0) != 0;
}

// The time of the newest record or use; the smallest time if there is none.
std::int64_t newest_record(Connection& connection) {
  Rows query = connection.query(
      "SELECT max(coalesce((SELECT max(used) FROM volumes), 0), coalesce((SELECT max(finished) "
      "FROM jobs), 0), coalesce((SELECT max(accepted) FROM jobs), 0))");
  query.next();
  return query.integer(0);
}

[[noreturn]] void refuse(std::string_view what) {
  throw Error(ErrorCode::kUnavailable,
              "the data folder: " + std::string(what) +
                  ". Restore the one that belongs to it. To continue with what is there, start "
                  "once with --adopt: files that the database does not name are then put into "
                  "quarantine, and jobs whose files are missing can be submitted again");
}

[[noreturn]] void throw_moved() {
  throw Error(ErrorCode::kUnavailable,
              "the records of the data folder were moved to a PostgreSQL database by `isomeshd "
              "move`: name it with --store. To continue with the old records that are still in "
              "the folder, start once with --adopt");
}

}  // namespace

void mark_as_moved(Database& database, const std::string& name) {
  Transaction transaction(database.writer());
  if (transaction->run("UPDATE identity SET number = ?", kMoved) == 0) {
    transaction->run("INSERT INTO identity VALUES(?, ?, 0)", name, kMoved);
  }
  transaction.commit();
}

void refuse_moved(Connection& connection) {
  if (connection.query("SELECT 1 FROM identity WHERE number = ?", kMoved).next()) throw_moved();
}

Identity::Identity(Database& database, BlobStore& blobs, const OperatorOverrides& overrides,
                   const BelievedClock::Options& clock)
    : database_(database),
      blobs_(blobs),
      clock_(time_to_start_with(last_seen(database, clock), overrides, clock), clock) {
  const Mark records = mark_of_database();
  const Mark theirs = mark_of_blobs();
  if (!overrides.adopt) check(records, theirs);
  const Time now = clock_.now();
  database_.know_newest(now);
  if (overrides.trust_clock) {
    trust(database_, database_.schemas(), last_seen(database, clock), now, clock.tolerance);
  }
  const Lock lock(mutex_);
  const bool belong_together = !records.id.empty() && records.id == theirs.id;
  mark_ = belong_together ? records : Mark{random_hex(16), 0, records.seen};
  mark_.number = std::max(mark_.number, theirs.id == mark_.id ? theirs.number : 0);
  write_mark(now);
}

Time Identity::now() {
  const Time time = clock_.now();
  database_.know_newest(time);
  const Lock lock(mutex_);
  try {
    if (!is_told_) write_blobs_mark();
    const bool is_changed = database_.changes() != changes_;
    if (is_changed || time - from_us(mark_.seen) > kBetweenIdleMarks) write_mark(time);
  } catch (const Error& error) {
    log_warning("the time of the newest record could not be saved and is retried: {}",
                error.what());
  }
  return time;
}

Time Identity::last_seen(Database& database, const BelievedClock::Options& clock) {
  const Reading reading(database.reader());
  Rows seen = reading->query("SELECT seen FROM identity");
  const std::int64_t marked = seen.next() ? seen.integer(0) : 0;
  const std::int64_t newest = marked > 0 ? marked : newest_record(reading.connection());
  return newest > 0 ? from_us(newest) : clock.wall();
}

Identity::Mark Identity::mark_of_database() const {
  const Reading reading(database_.reader());
  Rows query = reading->query("SELECT id, number, seen FROM identity");
  if (!query.next()) return {};
  return {query.text(0), query.integer(1), query.integer(2)};
}

Identity::Mark Identity::mark_of_blobs() const {
  const std::string text = blobs_.mark();
  const std::size_t space = text.find(' ');
  Mark mark = {text.substr(0, space)};
  if (space != std::string::npos) {
    std::from_chars(text.data() + space + 1, text.data() + text.size(), mark.number);
  }
  return mark;
}

void Identity::check(const Mark& records, const Mark& blobs) const {
  if (records.number == kMoved) throw_moved();
  const bool is_recorded = [&] {
    const Reading reading(database_.reader());
    return has_records(reading.connection());
  }();
  const bool is_stored = !blobs_.is_empty();
  // Two databases on one store would sweep each other's blobs.
  if (!is_recorded && blobs_.is_shared() && !blobs.id.empty() && blobs.id != records.id) {
    refuse("the storage of volumes and meshes belongs to another database");
  }
  if (!is_recorded && !is_stored) return;  // nothing can be lost
  // The database is marked first, so a crash may leave it one ahead.
  if (blobs.id.empty() && records.number == 1) return;
  if (!is_recorded && records.id != blobs.id) {
    refuse("there are files of volumes and meshes, but the database that names them is missing");
  }
  if (records.id != blobs.id) {
    refuse("the database and the files of volumes and meshes do not belong together");
  }
  if (records.number < blobs.number) {
    refuse("the database is older than the files of volumes and meshes");
  }
  if (records.number > blobs.number + 1) {
    refuse("the files of volumes and meshes are older than the database");
  }
}

// The database's mark is never more than one ahead.
void Identity::write_mark(Time time) {
  Mark next = mark_;
  next.number += 1;
  next.seen = to_us(time);
  {
    Transaction transaction(database_.writer());
    transaction->run("DELETE FROM identity");
    transaction->run("INSERT INTO identity VALUES(?, ?, ?)", next.id, next.number, next.seen);
    transaction.commit();
  }
  mark_ = next;
  changes_ = database_.changes();
  is_told_ = false;
  write_blobs_mark();
}

void Identity::write_blobs_mark() {
  blobs_.set_mark(mark_.id + ' ' + std::to_string(mark_.number) + '\n');
  is_told_ = true;
}

}  // namespace isomesh::store
