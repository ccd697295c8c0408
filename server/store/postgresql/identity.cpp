#include "server/store/postgresql/identity.h"

#include "base/ids.h"
#include "base/log.h"
#include "proto/error.h"
#include "server/store/microseconds.h"
#include "server/store/sql/trusted_clock.h"

namespace isomesh::store::postgresql {
namespace {

// The first word of the mark: SQLite's engine appends a number.
std::string name_of(const BlobStore& blobs) {
  const std::string mark = blobs.mark();
  return mark.substr(0, mark.find_first_of(" \n"));
}

void name(BlobStore& blobs, const std::string& name) { blobs.set_mark(name + '\n'); }

// The database's name; sets it to `proposed` if there is none.
std::string name_of_database(Database& database, const std::string& proposed) {
  return database.ask([&](Connection& connection, bool) {
    Transaction transaction(connection);
    transaction->query("LOCK TABLE identity IN SHARE ROW EXCLUSIVE MODE");
    transaction->query(
        "INSERT INTO identity SELECT ?1, isomesh_now() WHERE NOT EXISTS (SELECT 1 FROM identity)",
        proposed);
    Rows row = transaction->query("SELECT id FROM identity");
    row.next();
    const std::string name = row.text(0);
    transaction.commit();
    return name;
  });
}

// True if there are records that may name blobs.
bool has_records(Database& database) {
  Rows row = database.query(
      "SELECT EXISTS(SELECT 1 FROM named_blobs) OR EXISTS(SELECT 1 FROM jobs) OR EXISTS(SELECT 1 "
      "FROM expired)");
  row.next();
  return row.boolean(0);
}

// Gives both the same name. Daemons that start at the same time get the same one, and a start after
// a crash completes it.
void check(Database& database, BlobStore& blobs, bool may_adopt) {
  std::string mark = name_of(blobs);
  std::string proposed = random_hex(16);
  if (!blobs.is_shared() && blobs.is_empty()) {
    if (mark.empty()) name(blobs, mark = proposed);
    proposed = mark;  // reusing the old name loses nothing
  }
  const std::string named = name_of_database(database, proposed);
  if (mark == named) return;
  const bool is_new = mark.empty() && blobs.is_shared() && !has_records(database);
  if (!is_new && !may_adopt) {
    throw Error(
        ErrorCode::kUnavailable,
        "the database and the files of volumes and meshes do not belong together. Daemons that "
        "share a database must share the files by --blobs. Name the database that belongs to the "
        "files, or move their records there with `isomeshd move`. To continue with these, start "
        "once with --adopt: files that the database does not name are then put into quarantine");
  }
  name(blobs, named);
}

}  // namespace

Identity::Identity(Database& database, BlobStore& blobs, const OperatorOverrides& overrides,
                   std::chrono::milliseconds tolerance)
    : Identity(
          database, blobs, overrides,
          BelievedClock::Options{.tolerance = tolerance,
                                 .wall = [&database] { return store::from_us(database.now_us()); },
                                 .name = "the clock of the database"}) {}

Identity::Identity(Database& database, BlobStore& blobs, const OperatorOverrides& overrides,
                   const BelievedClock::Options& clock)
    : database_(database),
      clock_(time_to_start_with(last_seen(database), overrides, clock), clock) {
  check(database, blobs, overrides.adopt);
  if (overrides.trust_clock)
    trust(database, database.schemas(), last_seen(database), clock_.now(), clock.tolerance);
}

Time Identity::now() {
  const std::int64_t us = store::to_us(clock_.now());
  try {
    database_.query("UPDATE identity SET seen = ?1 WHERE seen < ?1", us);
  } catch (const Error& error) {
    log_warning("the time could not be recorded and is retried: {}", error.what());
  }
  return database_.from_us(us);
}

Time Identity::last_seen(Database& database) {
  Rows row = database.query("SELECT seen FROM identity");
  return store::from_us(row.next() ? row.integer(0) : database.now_us());
}

}  // namespace isomesh::store::postgresql
