#include "server/store/retention.h"

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "proto/error.h"

namespace isomesh::store {
namespace {

// Of one transaction, so that others are not held up for long.
constexpr int kMostAtOnce = 100;
// Longer than any upload or job leaves a file there.
constexpr std::chrono::hours kLongestScratch{24};
// More than a client that follows a job could have missed.
constexpr std::chrono::days kEventsKept{2};

// A finished job or a volume that no live job needs.
struct Item {
  bool is_job = false;
  std::string owner;
  std::string id;
};

std::int64_t us_before_now(std::chrono::milliseconds time) {
  return now_us() - std::chrono::microseconds(time).count();
}

// The `limit` oldest that were last of use before `cutoff`. Jobs without a mesh take no room, and
// go by their age alone.
std::vector<Item> oldest(Connection& connection, std::int64_t cutoff, bool with_bytes_only,
                         int limit) {
  Query query = connection.query(
      "SELECT 1 AS is_job, owner, id, finished AS last FROM jobs WHERE finished < ?1 AND "
      "(?2 = 0 OR EXISTS (SELECT 1 FROM meshes WHERE job = jobs.id)) "
      "UNION ALL SELECT 0, owner, id, used FROM volumes v WHERE used < ?1 AND NOT EXISTS "
      "(SELECT 1 FROM jobs j WHERE j.volume = v.id AND j.owner = v.owner AND j.state < 2) "
      "ORDER BY last LIMIT ?3",
      cutoff, with_bytes_only, limit);
  std::vector<Item> items;
  while (query.next()) items.push_back({query.integer(0) != 0, query.text(1), query.text(2)});
  return items;
}

bool is_named(Connection& connection, const std::string& blob) {
  Query query = connection.query(
      "SELECT EXISTS(SELECT 1 FROM volumes WHERE id = ?1) OR EXISTS(SELECT 1 FROM meshes WHERE "
      "blob = ?1)",
      blob);
  query.next();
  return query.integer(0) != 0;
}

std::vector<Blob> blobs_of(Connection& connection, const Item& item) {
  const auto read = [](Query&& query) {
    std::vector<Blob> blobs;
    while (query.next()) {
      blobs.push_back({query.text(0), static_cast<std::uint64_t>(query.integer(1))});
    }
    return blobs;
  };
  if (item.is_job) {
    return read(connection.query("SELECT blob, bytes FROM meshes WHERE job = ?", item.id));
  }
  return read(connection.query("SELECT id, bytes FROM volumes WHERE id = ? AND owner = ?", item.id,
                               item.owner));
}

// Returns how many bytes nothing names any more.
std::uint64_t expire(Connection& connection, const Item& item) {
  const std::vector<Blob> blobs = blobs_of(connection, item);
  if (item.is_job) {
    connection.run("DELETE FROM events WHERE job = ?", item.id);
    connection.run("DELETE FROM jobs WHERE id = ?", item.id);
  } else {
    connection.run("DELETE FROM volumes WHERE owner = ? AND id = ?", item.owner, item.id);
  }
  connection.run("INSERT OR REPLACE INTO expired VALUES(?, ?, ?)", item.id, item.owner, now_us());
  std::uint64_t freed = 0;
  for (const Blob& blob : blobs) freed += is_named(connection, blob.key) ? 0 : blob.bytes;
  return freed;
}

std::uint64_t bytes_named(Connection& connection) {
  Query query = connection.query(
      "SELECT coalesce(sum(bytes), 0) FROM (SELECT id, max(bytes) AS bytes FROM volumes GROUP BY "
      "id UNION ALL SELECT blob, max(bytes) FROM meshes GROUP BY blob)");
  query.next();
  return static_cast<std::uint64_t>(query.integer(0));
}

void count(Retention::Gone& gone, const Item& item) { ++(item.is_job ? gone.jobs : gone.volumes); }

}  // namespace

Retention::Gone Retention::enforce() {
  Gone gone = expire_old();
  if (options_.max_bytes > 0) expire_beyond(options_.max_bytes, gone);
  forget();
  gone.blobs = sweep_blobs();
  sweep_scratch();
  return gone;
}

void Retention::make_room(std::uint64_t bytes) {
  if (options_.max_bytes == 0) return;
  Gone gone;
  if (bytes <= options_.max_bytes && expire_beyond(options_.max_bytes - bytes, gone)) return;
  throw Error(ErrorCode::kOutOfSpace, "the room for volumes and meshes is used up");
}

std::uint64_t Retention::named_bytes() {
  const Reading reading(database_.reader());
  return bytes_named(reading.connection());
}

Retention::Gone Retention::expire_old() {
  Gone gone;
  const std::int64_t cutoff = us_before_now(options_.keep);
  while (true) {
    Transaction transaction(database_.writer());
    const std::vector<Item> items = oldest(transaction.connection(), cutoff, false, kMostAtOnce);
    for (const Item& item : items) {
      expire(transaction.connection(), item);
      count(gone, item);
    }
    transaction.commit();
    if (items.size() < kMostAtOnce) return gone;
  }
}

bool Retention::expire_beyond(std::uint64_t max_bytes, Gone& gone) {
  while (true) {
    Transaction transaction(database_.writer());
    const std::uint64_t named = bytes_named(transaction.connection());
    if (named <= max_bytes) return true;
    const std::vector<Item> items =
        oldest(transaction.connection(), now_us() + 1, true, kMostAtOnce);
    if (items.empty()) return false;
    // Several jobs may name the same mesh, of which only the last one's end frees the bytes.
    std::uint64_t freed = 0;
    for (const Item& item : items) {
      if (named - freed <= max_bytes) break;
      freed += expire(transaction.connection(), item);
      count(gone, item);
    }
    transaction.commit();
  }
}

std::size_t Retention::sweep_blobs() {
  // A worker may have stored, at any time since its run began, what it is about to name.
  std::int64_t cutoff = us_before_now(options_.grace);
  {
    const Reading reading(database_.reader());
    Query query = reading->query("SELECT min(claimed) FROM jobs WHERE state = 1");
    query.next();
    if (!query.is_null(0)) {
      cutoff =
          std::min(cutoff, query.integer(0) - std::chrono::microseconds(options_.grace).count());
    }
  }
  const auto is_kept = [&](const std::string& key) {
    const Reading reading(database_.reader());
    return is_named(reading.connection(), key) ||
           std::ranges::count(database_.unreadable(), key) > 0;  // a person is to look at it
  };
  return blobs_.sweep(std::chrono::system_clock::time_point(std::chrono::microseconds(cutoff)),
                      is_kept);
}

void Retention::sweep_scratch() {
  std::error_code gone;  // files come and go while we look
  const auto cutoff = std::filesystem::file_time_type::clock::now() - kLongestScratch;
  for (const auto& entry : std::filesystem::directory_iterator(folder_.scratch(), gone)) {
    const auto written = entry.last_write_time(gone);
    if (!gone && written < cutoff) std::filesystem::remove_all(entry.path(), gone);
  }
}

void Retention::forget() {
  Transaction transaction(database_.writer(), Durability::kProcess);
  transaction->run("DELETE FROM expired WHERE at < ?", us_before_now(options_.remember));
  transaction->run("DELETE FROM events WHERE id < ?", us_before_now(kEventsKept));
  transaction.commit();
}

}  // namespace isomesh::store
