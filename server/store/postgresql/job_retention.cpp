// What removes jobs that have ended, and what is known of them.
#include "server/store/postgresql/expiry.h"
#include "server/store/postgresql/job_store.h"
#include "server/store/postgresql/turn.h"

namespace isomesh::store::postgresql {

std::vector<Expirable> PostgresJobStore::ended(const ExpiryFilter& filter, Ended which,
                                               std::size_t limit) const {
  return read_expirable(
      database_, RecordKind::kJob,
      database_.run(
          "SELECT owner, id, finished FROM jobs WHERE finished < $1::bigint AND ($2::boolean IS "
          "FALSE OR EXISTS (SELECT 1 FROM meshes WHERE job = jobs.id)) AND ($4::text IS NULL OR "
          "owner = $4::text) ORDER BY finished LIMIT $3::bigint",
          database_.to_us(filter.before), which == Ended::kWithMesh, limit, filter.owner));
}

// Each is a transaction of its own, so that nobody waits for many.
Expired PostgresJobStore::expire(std::span<const Expirable> jobs, std::uint64_t enough) {
  Expired expired;
  for (const Expirable& job : jobs) {
    if (expired.bytes >= enough) break;
    add_expired(
        database_.run("SELECT blob, bytes FROM expire_job($1::text, $2::text)", job.id, job.owner),
        expired);
  }
  return expired;
}

std::shared_ptr<const void> PostgresJobStore::turn_to_remove() {
  auto turn = std::make_shared<Turn>(database_.url(), "removing");
  if (!turn->is_taken()) return nullptr;
  return turn;
}

std::uint64_t PostgresJobStore::named_bytes() const {
  Rows row = database_.run(
      "SELECT coalesce(sum(bytes), 0)::bigint FROM (SELECT max(bytes) AS bytes FROM meshes GROUP "
      "BY blob) AS each");
  row.next();
  return static_cast<std::uint64_t>(row.integer(0));
}

OwnedBytes PostgresJobStore::owned_bytes() const {
  return read_owned_bytes(database_.run(
      "SELECT owner, sum(bytes)::bigint FROM (SELECT owner, max(bytes) AS bytes FROM meshes JOIN "
      "jobs ON job = id GROUP BY owner, blob) AS each GROUP BY owner"));
}

std::optional<Steady> PostgresJobStore::oldest_run() const {
  Rows row = database_.run("SELECT min(claimed) FROM runs");
  row.next();
  if (row.is_null(0)) return std::nullopt;
  return database_.steady_of(row.integer(0));
}

void PostgresJobStore::forget_expired(Time before) {
  database_.run("DELETE FROM expired WHERE at < $1::bigint", database_.to_us(before));
}

void PostgresJobStore::forget_events(Time before) {
  database_.run("DELETE FROM events WHERE at < $1::bigint", database_.to_us(before));
}

}  // namespace isomesh::store::postgresql
