#include "server/store/postgresql/volume_store.h"

#include <algorithm>
#include <limits>

#include "proto/error.h"
#include "proto/json.h"
#include "server/store/microseconds.h"
#include "server/store/postgresql/expiry.h"

namespace isomesh::store::postgresql {
namespace {

// The record as it is listed, and whole where that is more.
struct Records {
  explicit Records(Volume volume)
      : labelled(volume.labels.empty() ? std::nullopt : std::optional(to_record(volume))) {
    volume.labels.clear();
    listed = to_record(volume);
  }

  std::optional<std::string> labelled;
  std::string listed;
};

std::optional<Volume> find(Connection& connection, const Viewer& viewer, const std::string& id,
                           const char* lock = "") {
  Rows rows = connection.run(
      std::string(
          "SELECT coalesce(labelled, record) FROM volumes WHERE id = $1::text AND ($2::text "
          "IS NULL OR owner = $2::text)") +
          lock,
      id, viewer);
  if (!rows.next()) return std::nullopt;
  return volume_from_record(rows.text(0));
}

[[noreturn]] void throw_missing(Connection& connection, const Viewer& viewer,
                                const std::string& id) {
  const bool is_gone = connection
                           .run(
                               "SELECT 1 FROM expired WHERE id = $1::text AND ($2::text IS NULL "
                               "OR owner = $2::text)",
                               id, viewer)
                           .next();
  if (is_gone) throw Error(ErrorCode::kGone, "the volume has expired: upload it again");
  throw Error(ErrorCode::kNotFound, "there is no volume with this id");
}

}  // namespace

std::pair<Volume, bool> PostgresVolumeStore::add(const std::string& owner, const Volume& volume) {
  const Records records(volume);
  // Asked again, it may be there by the first time: that is told by what was stored being the same.
  return database_.ask([&](Connection& connection, bool is_again) {
    Transaction transaction(connection);
    Rows rows = transaction->run(
        "INSERT INTO volumes AS v VALUES($1::text, $2::text, $3::bigint, isomesh_now(), "
        "$4::bigint, "
        "$5::text, $6::text) ON CONFLICT(owner, id) DO UPDATE SET used = excluded.used RETURNING "
        "xmax = 0, coalesce(labelled, record)",
        owner, volume.id, us_of_timestamp(volume.created), volume.bytes, records.listed,
        records.labelled);
    rows.next();
    const bool is_new = rows.boolean(0);
    const Volume stored = is_new ? volume : volume_from_record(rows.text(1));
    transaction->run("DELETE FROM expired WHERE id = $1::text AND owner = $2::text", volume.id,
                     owner);
    transaction.commit();
    return std::pair(stored, is_new || (is_again && stored == volume));
  });
}

Volume PostgresVolumeStore::get(const Viewer& viewer, const std::string& id) const {
  return database_.ask([&](Connection& connection, bool) {
    if (auto volume = find(connection, viewer, id)) return *std::move(volume);
    throw_missing(connection, viewer, id);
  });
}

Volume PostgresVolumeStore::rename(const std::string& owner, const std::string& id,
                                   const std::optional<std::string>& name) {
  return database_.ask([&](Connection& connection, bool) {
    Transaction transaction(connection);
    auto volume = find(connection, owner, id, " FOR NO KEY UPDATE");
    if (!volume) throw_missing(connection, owner, id);
    volume->name = name;
    const Records records(*volume);
    transaction->run(
        "UPDATE volumes SET record = $1::text, labelled = $2::text WHERE owner = $3::text AND id = "
        "$4::text",
        records.listed, records.labelled, owner, id);
    transaction.commit();
    return *volume;
  });
}

bool PostgresVolumeStore::contains(const Viewer& viewer, const std::string& id) const {
  return database_
      .run("SELECT 1 FROM volumes WHERE id = $1::text AND ($2::text IS NULL OR owner = $2::text)",
           id, viewer)
      .next();
}

std::vector<Volume> PostgresVolumeStore::list(const Viewer& viewer, const std::string& after,
                                              std::size_t limit, ListOrder order) const {
  const std::size_t space = after.find(' ');
  const std::string id = space == std::string::npos ? "" : after.substr(space + 1);
  const bool is_descending = order == ListOrder::kNewestFirst;
  const std::int64_t beginning = is_descending ? std::numeric_limits<std::int64_t>::max() : -1;
  Rows rows = database_.run(
      std::string("SELECT record FROM volumes WHERE ") +
          (viewer ? "owner = $1::text" : "$1::text IS NULL") + " AND (created, id) " +
          (is_descending
               ? "< ($2::bigint, $3::text) ORDER BY created DESC, id DESC LIMIT $4::bigint"
               : "> ($2::bigint, $3::text) ORDER BY created, id LIMIT $4::bigint"),
      viewer, after.empty() ? beginning : us_of_timestamp(after.substr(0, space)), id,
      std::min<std::size_t>(limit, 1 << 30));
  std::vector<Volume> volumes;
  while (rows.next()) volumes.push_back(volume_from_record(rows.text(0)));
  return volumes;
}

// The rows are locked before their jobs are looked at, so that nobody submits one meanwhile.
void PostgresVolumeStore::erase(const Viewer& viewer, const std::string& id) {
  database_.ask([&](Connection& connection, bool is_again) {
    Transaction transaction(connection);
    if (!find(connection, viewer, id, " FOR UPDATE")) {
      if (is_again) return;
      throw_missing(connection, viewer, id);
    }
    const bool is_needed = transaction
                               ->run(
                                   "SELECT 1 FROM jobs WHERE volume = $1::text AND ($2::text IS "
                                   "NULL OR owner = $2::text) AND state < 2 LIMIT 1",
                                   id, viewer)
                               .next();
    if (is_needed) {
      throw Error(ErrorCode::kNotReady, "unfinished jobs need this volume");
    }
    transaction->run(
        "DELETE FROM volumes WHERE id = $1::text AND ($2::text IS NULL OR owner = $2::text)", id,
        viewer);
    transaction.commit();
  });
}

bool PostgresVolumeStore::names(const std::string& blob) const {
  Rows row = database_.run("SELECT is_named($1::text)", blob);
  row.next();
  return row.boolean(0);
}

std::vector<Expirable> PostgresVolumeStore::unused(const ExpiryFilter& filter,
                                                   std::size_t limit) const {
  return read_expirable(
      database_, RecordKind::kVolume,
      database_.run(
          "SELECT owner, id, used FROM volumes v WHERE used < $1::bigint AND NOT EXISTS (SELECT 1 "
          "FROM jobs j WHERE j.volume = v.id AND j.owner = v.owner AND j.state < 2) AND ($3::text "
          "IS NULL OR owner = $3::text) ORDER BY used LIMIT $2::bigint",
          database_.to_us(filter.before), limit, filter.owner));
}

Expired PostgresVolumeStore::expire(std::span<const Expirable> volumes, std::uint64_t enough) {
  Expired expired;
  for (const Expirable& volume : volumes) {
    if (expired.bytes >= enough) break;
    add_expired(
        database_.run("SELECT blob, bytes FROM expire_volume($1::text, $2::text, $3::bigint)",
                      volume.owner, volume.id, database_.to_us(volume.last_used)),
        expired);
  }
  return expired;
}

std::uint64_t PostgresVolumeStore::named_bytes() const {
  Rows row = database_.run(
      "SELECT coalesce(sum(bytes), 0)::bigint FROM (SELECT max(bytes) AS bytes FROM volumes GROUP "
      "BY id) AS each");
  row.next();
  return static_cast<std::uint64_t>(row.integer(0));
}

OwnedBytes PostgresVolumeStore::owned_bytes() const {
  return read_owned_bytes(
      database_.run("SELECT owner, sum(bytes)::bigint FROM volumes GROUP BY owner"));
}

}  // namespace isomesh::store::postgresql
