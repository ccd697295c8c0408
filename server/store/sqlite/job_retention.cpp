// What removes jobs that have ended, and what is known of them.
#include <algorithm>

#include "server/store/sqlite/expiry.h"
#include "server/store/sqlite/job_store.h"

namespace isomesh::store {

std::vector<Expirable> SqliteJobStore::ended(const ExpiryFilter& filter, Ended which,
                                             std::size_t limit) const {
  const Reading reading(database_.reader());
  Query query = reading->query(
      "SELECT owner, id, finished FROM jobs WHERE finished < ?1 AND (?2 = 0 OR EXISTS (SELECT 1 "
      "FROM meshes WHERE job = jobs.id)) AND (?4 IS NULL OR owner = ?4) ORDER BY finished LIMIT ?3",
      to_us(filter.before), which == Ended::kWithMesh, limit, filter.owner);
  std::vector<Expirable> jobs;
  while (query.next()) {
    jobs.push_back({RecordKind::kJob, query.text(0), query.text(1), from_us(query.integer(2))});
  }
  return jobs;
}

Expired SqliteJobStore::expire(std::span<const Expirable> jobs, std::uint64_t enough) {
  return database_.freeing([&] {
    Transaction transaction(database_.writer());
    Expired expired;
    for (const Expirable& job : jobs) {
      if (expired.bytes >= enough) break;
      const std::vector<Blob> blobs =
          read_blobs(transaction->query("SELECT blob, bytes FROM meshes WHERE job = ?", job.id));
      const int removed =
          transaction->run("DELETE FROM jobs WHERE id = ? AND finished IS NOT NULL", job.id);
      if (removed == 0) continue;
      transaction->run("DELETE FROM events WHERE job = ?", job.id);
      remember_expired(transaction.connection(), job);
      ++expired.records;
      add_unnamed(transaction.connection(), blobs, expired);
    }
    transaction.commit();
    return expired;
  });
}

std::uint64_t SqliteJobStore::named_bytes() const {
  const Reading reading(database_.reader());
  Query query = reading->query(
      "SELECT coalesce(sum(bytes), 0) FROM (SELECT max(bytes) AS bytes FROM meshes GROUP BY blob)");
  query.next();
  return static_cast<std::uint64_t>(query.integer(0));
}

OwnedBytes SqliteJobStore::owned_bytes() const {
  const Reading reading(database_.reader());
  return read_owned_bytes(reading->query(
      "SELECT owner, sum(bytes) FROM (SELECT owner, max(bytes) AS bytes FROM meshes JOIN jobs ON "
      "job = id GROUP BY owner, blob) GROUP BY owner"));
}

std::optional<Steady> SqliteJobStore::oldest_run() const {
  const Lock lock(live_mutex_);
  std::optional<Steady> oldest;
  for (const auto& [id, run] : live_) oldest = std::min(oldest.value_or(run.claimed), run.claimed);
  return oldest;
}

void SqliteJobStore::forget_expired(Time before) {
  database_.freeing([&] {
    Transaction transaction(database_.writer(), Durability::kProcess);
    transaction->run("DELETE FROM expired WHERE at < ?", to_us(before));
    transaction.commit();
  });
}

void SqliteJobStore::forget_events(Time before) {
  database_.freeing([&] {
    Transaction transaction(database_.writer(), Durability::kProcess);
    transaction->run("DELETE FROM events WHERE id < ?", to_us(before));
    transaction.commit();
  });
}

}  // namespace isomesh::store
