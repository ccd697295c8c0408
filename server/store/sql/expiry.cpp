#include "server/store/sql/expiry.h"

#include <algorithm>

#include "server/store/sql/schema.h"

namespace isomesh::store {
namespace {

// Remembers the id of a removed record as expired.
void note(SqlConnection& connection, const Expirable& record, const std::vector<Blob>& blobs,
          Expired& expired) {
  connection.run(
      "INSERT INTO expired(id, owner, at) VALUES(?1, ?2, isomesh_kept(isomesh_now())) ON "
      "CONFLICT(id, owner) DO UPDATE SET at = excluded.at",
      record.id, record.owner);
  expired.records.push_back(record);
  for (const Blob& blob : blobs) {
    if (is_named(connection, blob.key)) continue;
    expired.bytes += blob.bytes;
    expired.blobs.push_back(blob.key);
  }
}

}  // namespace

std::vector<Expirable> read_expirable(const SqlDatabase& database, RecordKind kind, Rows rows) {
  std::vector<Expirable> items;
  while (rows.next()) {
    items.push_back({kind, rows.text(0), rows.text(1), database.from_us(rows.integer(2))});
  }
  return items;
}

std::vector<Blob> read_blobs(Rows rows) {
  std::vector<Blob> blobs;
  while (rows.next()) blobs.push_back({rows.text(0), rows.count(1)});
  return blobs;
}

void erase_jobs(SqlConnection& connection, std::span<const std::string> jobs,
                const BlobsGoing& going) {
  std::vector<std::string> keys;
  for (const std::string& job : jobs) {
    for (const Blob& blob :
         read_blobs(connection.query("SELECT blob, bytes FROM meshes WHERE job = ?1", job))) {
      keys.push_back(blob.key);
    }
  }
  if (going) going(keys);
  for (const std::string& job : jobs) {
    connection.run("DELETE FROM jobs WHERE id = ?1", job);
    delete_events_before_end(connection, job);
    connection.run("DELETE FROM callbacks WHERE job = ?1", job);
  }
}

void delete_events_before_end(SqlConnection& connection, const std::string& job) {
  connection.run("DELETE FROM events WHERE job = ?1 AND kind <> {event.done}", job);
}

std::uint64_t sum_of_blobs(SqlDatabase& database, const std::string& table,
                           const std::string& key) {
  Rows row =
      database.query("SELECT coalesce(sum(bytes), 0) FROM (SELECT max(bytes) AS bytes FROM " +
                     table + " GROUP BY " + key + ") AS each");
  row.next();
  return row.count(0);
}

OwnedBytes read_owned_bytes(Rows rows) {
  OwnedBytes bytes;
  while (rows.next()) bytes[rows.text(0)] = rows.count(1);
  return bytes;
}

bool has_expired(SqlConnection& connection, const std::optional<std::string>& viewer,
                 const std::string& id) {
  return connection
      .query("SELECT 1 FROM expired WHERE id = ?1 AND (?2 IS NULL OR owner = ?2)", id, viewer)
      .next();
}

Expired expire_records(SqlDatabase& database, std::span<const Expirable> records,
                       std::uint64_t enough, const Remove& remove) {
  Expired all;
  while (!records.empty() && all.bytes < enough) {
    const auto some = records.first(std::min(records.size(), database.most_at_once()));
    records = records.subspan(some.size());
    const Expired expired = database.change(Change::kNeeded, [&](SqlTransaction& transaction) {
      Expired now;
      for (const Expirable& record : some) {
        if (now.bytes >= enough) break;
        const auto blobs = remove(transaction.connection(), record);
        if (blobs) note(transaction.connection(), record, *blobs, now);
      }
      transaction.commit();
      return now;
    });
    all.records.insert(all.records.end(), expired.records.begin(), expired.records.end());
    all.bytes += expired.bytes;
    all.blobs.insert(all.blobs.end(), expired.blobs.begin(), expired.blobs.end());
  }
  return all;
}

}  // namespace isomesh::store
