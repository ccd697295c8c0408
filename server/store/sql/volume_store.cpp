#include "server/store/sql/volume_store.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <map>
#include <utility>

#include "proto/json.h"
#include "server/store/damaged_records.h"
#include "server/store/microseconds.h"
#include "server/store/sql/expiry.h"
#include "server/store/sql/schema.h"
#include "server/store/sql/undamaged_rows.h"

namespace isomesh::store {
namespace {

constexpr DamagedTable kVolumes = {"volumes", "SELECT record FROM volumes", "owner, id",
                                   "owner DESC, id DESC"};

// The record for lists, and the complete one if that is larger.
struct Records {
  explicit Records(Volume volume)
      : labelled(volume.labels.empty() ? std::nullopt : std::optional(to_record(volume))) {
    volume.labels.clear();
    listed = to_record(volume);
  }

  std::optional<std::string> labelled;
  std::string listed;
};

[[noreturn]] void throw_damaged() { throw_damaged_volume("id"); }

// Empty if there is none. Throws Error kInternal if the record is damaged.
std::optional<Volume> volume_at(SqlConnection& connection, const Viewer& viewer,
                                const std::string& id, const char* lock = "") {
  Rows row = connection.query(
      std::string("SELECT coalesce(labelled, record) FROM volumes WHERE id = ?1 AND (?2 IS NULL OR "
                  "owner = ?2)") +
          lock,
      id, viewer);
  if (!row.next()) return std::nullopt;
  auto volume = readable_volume(row.text(0), id);
  if (!volume) throw_damaged();
  return volume;
}

[[noreturn]] void throw_missing(SqlConnection& connection, const Viewer& viewer,
                                const std::string& id) {
  if (has_expired(connection, viewer, id)) {
    throw Error(ErrorCode::kGone, "the volume has expired: upload it again");
  }
  throw Error(ErrorCode::kNotFound, "there is no volume with this id");
}

void throw_if_needed(SqlConnection& connection, const Viewer& viewer, const std::string& id) {
  Rows needed = connection.query(
      "SELECT 1 FROM jobs WHERE volume = ?1 AND (?2 IS NULL OR owner = ?2) AND state < {job.final} "
      "LIMIT 1",
      id, viewer);
  if (needed.next()) throw Error(ErrorCode::kNotReady, "unfinished jobs need this volume");
}

std::vector<std::string> texts_in(Rows rows) {
  std::vector<std::string> texts;
  while (rows.next()) texts.push_back(rows.text(0));
  return texts;
}

void erase_jobs_on(SqlConnection& connection, const Viewer& viewer, const std::string& id,
                   const BlobsGoing& going) {
  const std::string mine = viewer ? "owner = ?2" : "?2 IS NULL";
  const std::vector<std::string> jobs =
      texts_in(connection.query("SELECT id FROM jobs WHERE volume = ?1 AND " + mine +
                                    " AND state >= {job.final}" + connection.for_update(),
                                id, viewer));
  erase_jobs(connection, jobs, going);
}

// The owner's existing record; sets its time of last use.
std::optional<Volume> use(SqlConnection& connection, const std::string& owner,
                          const std::string& id) {
  Rows known = connection.query(
      "UPDATE volumes SET used = CASE WHEN used > isomesh_kept(isomesh_now()) THEN used ELSE "
      "isomesh_kept(isomesh_now()) END WHERE owner = ?1 AND id = ?2 RETURNING coalesce(labelled, "
      "record)",
      owner, id);
  if (!known.next()) return std::nullopt;
  auto volume = readable_volume(known.text(0), id);
  if (!volume) throw_damaged();
  return volume;
}

// Empty if the record is damaged. The place of the next page follows from the record's time.
std::optional<Volume> readable_at(const VolumePlace& place, const std::string& record) {
  auto volume = readable_volume(record, place.id);
  if (!volume || us_of_timestamp(volume->created) == place.created) return volume;
  report_damaged("volume", place.id);
  return std::nullopt;
}

bool insert(SqlConnection& connection, const std::string& owner, const Volume& volume,
            const Records& records) {
  const std::size_t inserted = connection.run(
      "INSERT INTO volumes(owner, id, created, used, blob, bytes, record, labelled) VALUES(?1, ?2, "
      "?3, isomesh_kept(isomesh_now()), ?4, ?5, ?6, ?7) ON CONFLICT(owner, id) DO NOTHING",
      owner, volume.id, us_of_timestamp(volume.created), volume.samples, volume.bytes,
      records.listed, records.labelled);
  if (inserted == 0) return false;
  connection.run("DELETE FROM expired WHERE id = ?1 AND owner = ?2", volume.id, owner);
  return true;
}

}  // namespace

VolumePlace::VolumePlace(const std::string& cursor, ListOrder order)
    : created(order == ListOrder::kNewestFirst ? std::numeric_limits<std::int64_t>::max() : -1) {
  if (cursor.empty()) return;
  const std::size_t space = cursor.find(' ');
  created = us_of_timestamp(cursor.substr(0, space));
  if (space != std::string::npos) id = cursor.substr(space + 1);
}

std::pair<Volume, bool> SqlVolumeStore::add(const std::string& owner, const Volume& volume) {
  const Records records(volume);
  return database_.change(Change::kNew, [&](SqlTransaction& transaction) {
    // An existing record may be erased before it is used.
    while (!insert(transaction.connection(), owner, volume, records)) {
      const auto known = use(transaction.connection(), owner, volume.id);
      if (!known) continue;
      transaction.commit();
      // After a repetition, an identical record was stored by the first attempt.
      return std::pair(*known, transaction.is_again() && *known == volume);
    }
    transaction.commit();
    return std::pair(volume, true);
  });
}

Volume SqlVolumeStore::get(const Viewer& viewer, const std::string& id) const {
  return database_.read([&](SqlConnection& connection) {
    if (auto volume = volume_at(connection, viewer, id)) return *std::move(volume);
    throw_missing(connection, viewer, id);
  });
}

Volume SqlVolumeStore::rename(const std::string& owner, const std::string& id,
                              const std::optional<std::string>& name) {
  return database_.change(Change::kNew, [&](SqlTransaction& transaction) {
    SqlConnection& connection = transaction.connection();
    auto volume = volume_at(connection, owner, id, connection.for_update());
    if (!volume) throw_missing(connection, owner, id);
    volume->name = name;
    const Records records(*volume);
    connection.run("UPDATE volumes SET record = ?1, labelled = ?2 WHERE owner = ?3 AND id = ?4",
                   records.listed, records.labelled, owner, id);
    transaction.commit();
    return *volume;
  });
}

std::optional<std::string> SqlVolumeStore::samples_of(const Viewer& viewer,
                                                      const std::string& id) const {
  Rows row = database_.query(
      "SELECT blob FROM volumes WHERE id = ?1 AND (?2 IS NULL OR owner = ?2) LIMIT 1", id, viewer);
  return row.next() ? std::optional(row.text(0)) : std::nullopt;
}

bool SqlVolumeStore::has_samples(const std::string& owner, const std::string& samples) const {
  return database_
      .query("SELECT 1 FROM volumes WHERE blob = ?1 AND owner = ?2 LIMIT 1", samples, owner)
      .next();
}

std::string SqlVolumeStore::key() const {
  Rows row = database_.query("SELECT key FROM volume_key");
  if (!row.next()) throw Error(ErrorCode::kInternal, "The database has lost the key of its ids.");
  return row.text(0);
}

std::vector<Volume> SqlVolumeStore::list(const Viewer& viewer, const std::string& after,
                                         std::size_t limit, ListOrder order) const {
  const VolumePlace place(after, order);
  return list_despite_damage([&] { return list_after(place, viewer, limit, order); },
                             [&] { return undamaged_after(place, viewer, limit, order); });
}

std::vector<Volume> SqlVolumeStore::list_after(VolumePlace place, const Viewer& viewer,
                                               std::size_t limit, ListOrder order) const {
  const std::string select =
      std::string("SELECT record, created, id FROM volumes WHERE ") +
      (viewer ? "owner = ?1" : "?1 IS NULL") + " AND (created, id) " +
      (order == ListOrder::kNewestFirst ? "< (?2, ?3) ORDER BY created DESC, id DESC LIMIT ?4"
                                        : "> (?2, ?3) ORDER BY created, id LIMIT ?4");
  std::vector<Volume> volumes;
  // Repeats only if unreadable records were skipped, because fewer than `limit` records mean the
  // end of the list.
  for (bool is_over = false; !is_over && volumes.size() < limit;) {
    std::size_t left = std::min<std::size_t>(limit - volumes.size(), 1 << 30);
    Rows rows = database_.query(select, viewer, place.created, place.id, left);
    for (; rows.next(); --left) {
      place = {rows.integer(1), rows.text(2)};
      if (auto volume = readable_at(place, rows.text(0))) volumes.push_back(*std::move(volume));
    }
    is_over = left > 0;
  }
  return volumes;
}

std::vector<Volume> SqlVolumeStore::undamaged_after(const VolumePlace& place, const Viewer& viewer,
                                                    std::size_t limit, ListOrder order) const {
  const bool is_descending = order == ListOrder::kNewestFirst;
  std::map<VolumePlace, Volume> found;
  const auto take = [&](const Rows& rows) {
    const VolumePlace at = {rows.integer(1), rows.text(2)};
    if (is_descending ? at >= place : at <= place) return;
    auto volume = readable_at(at, rows.text(0));
    if (volume) found.emplace(at, *std::move(volume));
    if (found.size() > limit) found.erase(is_descending ? found.begin() : std::prev(found.end()));
  };
  read_undamaged(database_, kVolumes,
                 "SELECT record, created, id FROM volumes WHERE (?1 IS NULL OR owner = ?1)", take,
                 viewer);
  std::vector<Volume> volumes;
  for (auto& [at, volume] : found) volumes.push_back(std::move(volume));
  if (is_descending) std::ranges::reverse(volumes);
  return volumes;
}

// Locks the rows before checking for jobs, so that no job is submitted in between.
void SqlVolumeStore::erase(const Viewer& viewer, const std::string& id, Made made,
                           const BlobsGoing& going) {
  database_.change(Change::kNeeded, [&](SqlTransaction& transaction) {
    SqlConnection& connection = transaction.connection();
    // Does not read the records, so that damaged ones can be erased too.
    const std::vector<std::string> samples = texts_in(
        connection.query(std::string("SELECT blob FROM volumes WHERE id = ?1 AND (?2 IS NULL OR "
                                     "owner = ?2)") +
                             connection.for_update(),
                         id, viewer));
    if (samples.empty()) {
      if (transaction.is_again()) return;
      throw_missing(connection, viewer, id);
    }
    throw_if_needed(connection, viewer, id);
    if (going) going(samples);
    if (made == Made::kErased) erase_jobs_on(connection, viewer, id, going);
    connection.run("DELETE FROM volumes WHERE id = ?1 AND (?2 IS NULL OR owner = ?2)", id, viewer);
    transaction.commit();
  });
}

bool SqlVolumeStore::names(const std::string& blob) const {
  return database_.read([&](SqlConnection& connection) { return is_named(connection, blob); });
}

std::vector<Expirable> SqlVolumeStore::unused(const ExpiryFilter& filter, std::size_t limit) const {
  return read_expirable(
      database_, RecordKind::kVolume,
      database_.query(
          "SELECT owner, id, used FROM volumes v WHERE used < ?1 AND NOT EXISTS (SELECT 1 FROM "
          "jobs j WHERE j.volume = v.id AND j.owner = v.owner AND j.state < {job.final}) AND (?3 "
          "IS NULL OR owner = ?3) ORDER BY used LIMIT ?2",
          database_.to_us(filter.before), limit, filter.owner));
}

Expired SqlVolumeStore::expire(std::span<const Expirable> volumes, std::uint64_t enough) {
  return expire_records(
      database_, volumes, enough, [&](SqlConnection& connection, const Expirable& volume) {
        std::vector<Blob> blobs = read_blobs(connection.query(
            std::string("SELECT blob, bytes FROM volumes WHERE owner = ?1 AND id = ?2 AND used "
                        "= ?3") +
                connection.for_update(),
            volume.owner, volume.id, database_.to_us(volume.last_used)));
        const std::size_t removed = connection.run(
            "DELETE FROM volumes WHERE owner = ?1 AND id = ?2 AND used = ?3 AND NOT EXISTS (SELECT "
            "1 FROM jobs WHERE volume = ?2 AND owner = ?1 AND state < {job.final})",
            volume.owner, volume.id, database_.to_us(volume.last_used));
        return removed == 0 ? std::nullopt : std::optional(std::move(blobs));
      });
}

std::uint64_t SqlVolumeStore::named_bytes() const {
  return sum_of_blobs(database_, "volumes", "blob");
}

OwnedBytes SqlVolumeStore::owned_bytes() const {
  return read_owned_bytes(
      database_.query("SELECT owner, sum(bytes) FROM (SELECT owner, max(bytes) AS bytes FROM "
                      "volumes GROUP BY owner, "
                      "blob) AS each GROUP BY owner"));
}

std::optional<Volume> VolumeStore::find(const Viewer& viewer, const std::string& id) const {
  try {
    return get(viewer, id);
  } catch (const Error& error) {
    const bool is_gone = error.code() == ErrorCode::kNotFound || error.code() == ErrorCode::kGone;
    if (is_gone || is_of_damaged_volume(error) || is_of_damaged_database(error)) {
      return std::nullopt;
    }
    throw;
  }
}

std::string cursor_of(const Volume& volume) { return volume.created + ' ' + volume.id; }

}  // namespace isomesh::store
