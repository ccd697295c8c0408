#include "server/store/sqlite/volume_store.h"

#include <algorithm>

#include "proto/json.h"
#include "server/store/sqlite/expiry.h"

namespace isomesh::store {
namespace {

// The record; empty when there is none.
std::optional<Volume> find(Connection& connection, const Viewer& viewer, const std::string& id) {
  Query query = connection.query(
      "SELECT record FROM volumes WHERE id = ?1 AND (?2 IS NULL OR owner = ?2)", id, viewer);
  if (!query.next()) return std::nullopt;
  return volume_from_record(query.text(0));
}

[[noreturn]] void throw_missing(Connection& connection, const Viewer& viewer,
                                const std::string& id) {
  Query expired = connection.query(
      "SELECT 1 FROM expired WHERE id = ?1 AND (?2 IS NULL OR owner = ?2)", id, viewer);
  if (expired.next()) throw Error(ErrorCode::kGone, "the volume has expired: upload it again");
  throw Error(ErrorCode::kNotFound, "there is no volume with this id");
}

}  // namespace

std::pair<Volume, bool> SqliteVolumeStore::add(const std::string& owner, const Volume& volume) {
  Transaction transaction(database_.writer());
  const std::int64_t now = now_us();
  if (const auto known = find(transaction.connection(), owner, volume.id)) {
    transaction->run("UPDATE volumes SET used = ? WHERE owner = ? AND id = ?", now, owner,
                     volume.id);
    transaction.commit();
    return {*known, false};
  }
  transaction->run("INSERT INTO volumes VALUES(?, ?, ?, ?, ?, ?)", owner, volume.id,
                   us_of_timestamp(volume.created), now, volume.bytes, to_record(volume));
  transaction->run("DELETE FROM expired WHERE id = ? AND owner = ?", volume.id, owner);
  transaction.commit();
  return {volume, true};
}

Volume SqliteVolumeStore::get(const Viewer& viewer, const std::string& id) const {
  const Reading reading(database_.reader());
  if (auto volume = find(reading.connection(), viewer, id)) return *volume;
  throw_missing(reading.connection(), viewer, id);
}

Volume SqliteVolumeStore::rename(const std::string& owner, const std::string& id,
                                 const std::optional<std::string>& name) {
  Transaction transaction(database_.writer());
  auto volume = find(transaction.connection(), owner, id);
  if (!volume) throw_missing(transaction.connection(), owner, id);
  volume->name = name;
  transaction->run("UPDATE volumes SET record = ? WHERE owner = ? AND id = ?", to_record(*volume),
                   owner, id);
  transaction.commit();
  return *volume;
}

bool SqliteVolumeStore::contains(const Viewer& viewer, const std::string& id) const {
  const Reading reading(database_.reader());
  return find(reading.connection(), viewer, id).has_value();
}

std::vector<Volume> SqliteVolumeStore::list(const Viewer& viewer, const std::string& after,
                                            std::size_t limit, ListOrder order) const {
  std::vector<Volume> volumes;
  for (const std::string& record : records(viewer, after, limit, order)) {
    volumes.push_back(volume_from_record(record));
  }
  return volumes;
}

// Without a look at what is in them, so that others do not wait for that.
std::vector<std::string> SqliteVolumeStore::records(const Viewer& viewer, const std::string& after,
                                                    std::size_t limit, ListOrder order) const {
  const std::size_t space = after.find(' ');
  const std::int64_t created = us_of_timestamp(after.substr(0, space));
  const std::string id = space == std::string::npos ? "" : after.substr(space + 1);
  const Reading reading(database_.reader());
  const bool is_descending = order == ListOrder::kNewestFirst;
  const std::int64_t beginning = is_descending ? std::numeric_limits<std::int64_t>::max() : -1;
  Query query = reading->query(
      std::string("SELECT iif(instr(record, '\"labels\":['), json_remove(record, '$.labels'), "
                  "record) FROM volumes WHERE (?1 IS NULL OR owner = ?1) AND (created, id) ") +
          (is_descending ? "< (?2, ?3) ORDER BY created DESC, id DESC LIMIT ?4"
                         : "> (?2, ?3) ORDER BY created, id LIMIT ?4"),
      viewer, after.empty() ? beginning : created, id,
      static_cast<std::int64_t>(std::min<std::size_t>(limit, 1 << 30)));
  std::vector<std::string> records;
  while (query.next()) records.push_back(query.text(0));
  return records;
}

void SqliteVolumeStore::erase(const Viewer& viewer, const std::string& id) {
  database_.freeing([&] {
    Transaction transaction(database_.writer());
    if (!find(transaction.connection(), viewer, id)) {
      throw_missing(transaction.connection(), viewer, id);
    }
    {
      Query needed = transaction->query(
          "SELECT 1 FROM jobs WHERE volume = ?1 AND (?2 IS NULL OR owner = ?2) AND state < 2 LIMIT "
          "1",
          id, viewer);
      if (needed.next()) {
        throw Error(ErrorCode::kNotReady, "unfinished jobs need this volume");
      }
    }
    transaction->run("DELETE FROM volumes WHERE id = ?1 AND (?2 IS NULL OR owner = ?2)", id,
                     viewer);
    transaction.commit();
  });
}

bool SqliteVolumeStore::names(const std::string& blob) const {
  const Reading reading(database_.reader());
  return is_named(reading.connection(), blob);
}

std::vector<Expirable> SqliteVolumeStore::unused(const ExpiryFilter& filter,
                                                 std::size_t limit) const {
  const Reading reading(database_.reader());
  Query query = reading->query(
      "SELECT owner, id, used FROM volumes v WHERE used < ?1 AND NOT EXISTS (SELECT 1 FROM jobs j "
      "WHERE j.volume = v.id AND j.owner = v.owner AND j.state < 2) AND (?3 IS NULL OR owner = ?3) "
      "ORDER BY used LIMIT ?2",
      to_us(filter.before), limit, filter.owner);
  std::vector<Expirable> volumes;
  while (query.next()) {
    volumes.push_back(
        {RecordKind::kVolume, query.text(0), query.text(1), from_us(query.integer(2))});
  }
  return volumes;
}

Expired SqliteVolumeStore::expire(std::span<const Expirable> volumes, std::uint64_t enough) {
  return database_.freeing([&] {
    Transaction transaction(database_.writer());
    Expired expired;
    for (const Expirable& volume : volumes) {
      if (expired.bytes >= enough) break;
      const std::vector<Blob> blobs = read_blobs(transaction->query(
          "SELECT id, bytes FROM volumes WHERE owner = ? AND id = ?", volume.owner, volume.id));
      const int removed = transaction->run(
          "DELETE FROM volumes WHERE owner = ?1 AND id = ?2 AND used = ?3 AND NOT EXISTS (SELECT 1 "
          "FROM jobs WHERE volume = ?2 AND owner = ?1 AND state < 2)",
          volume.owner, volume.id, to_us(volume.last_used));
      if (removed == 0) continue;
      remember_expired(transaction.connection(), volume);
      ++expired.records;
      add_unnamed(transaction.connection(), blobs, expired);
    }
    transaction.commit();
    return expired;
  });
}

std::uint64_t SqliteVolumeStore::named_bytes() const {
  const Reading reading(database_.reader());
  Query query = reading->query(
      "SELECT coalesce(sum(bytes), 0) FROM (SELECT max(bytes) AS bytes FROM volumes GROUP BY id)");
  query.next();
  return static_cast<std::uint64_t>(query.integer(0));
}

OwnedBytes SqliteVolumeStore::owned_bytes() const {
  const Reading reading(database_.reader());
  return read_owned_bytes(reading->query("SELECT owner, sum(bytes) FROM volumes GROUP BY owner"));
}

std::string cursor_of(const Volume& volume) { return volume.created + ' ' + volume.id; }

}  // namespace isomesh::store
