#include "server/hospital/records/received_store.h"

namespace isomesh::store {

// If the connection is lost, a repetition returns no blob; the replaced one is swept.
std::optional<std::string> ReceivedStore::add(const ReceivedSeries& series,
                                              const ReceivedInstance& instance) {
  using Replaced = std::optional<std::string>;
  return database_.change(Change::kNew, [&](SqlTransaction& transaction) -> Replaced {
    Replaced replaced;
    {
      Rows row = transaction->query(
          std::string("SELECT blob FROM received WHERE route = ?1 AND study = ?2 AND series = ?3 "
                      "AND instance = ?4 AND blob <> ?5") +
              transaction->for_update(),
          series.route, series.study, series.series, instance.instance, instance.blob);
      if (row.next()) replaced = row.text(0);
    }
    transaction->run(
        "INSERT INTO received(route, study, series, instance, blob, bytes, at) VALUES(?1, ?2, ?3, "
        "?4, ?5, ?6, isomesh_now()) ON CONFLICT(route, study, series, instance) DO UPDATE SET "
        "blob = excluded.blob, bytes = excluded.bytes, at = excluded.at",
        series.route, series.study, series.series, instance.instance, instance.blob,
        instance.bytes);
    transaction.commit();
    return replaced;
  });
}

std::vector<HeldSeries> ReceivedStore::held() const {
  Rows rows = database_.query(
      "SELECT h.route, h.study, h.series, count(*), max(h.at), (SELECT count(*) FROM received k "
      "WHERE k.route = h.route AND k.study = h.study AND k.series = h.series) FROM received h "
      "WHERE h.blob IS NOT NULL GROUP BY h.route, h.study, h.series ORDER BY 1, 2, 3");
  std::vector<HeldSeries> all;
  while (rows.next()) {
    all.push_back({.series = {rows.text(0), rows.text(1), rows.text(2)},
                   .held = static_cast<std::uint32_t>(rows.integer(3)),
                   .known = static_cast<std::uint32_t>(rows.integer(5)),
                   .last = database_.from_us(rows.integer(4))});
  }
  return all;
}

std::uint64_t ReceivedStore::held_bytes() const {
  Rows row = database_.query("SELECT coalesce(sum(bytes), 0) FROM received WHERE blob IS NOT NULL");
  row.next();
  return row.count(0);
}

std::vector<ReceivedInstance> ReceivedStore::instances(const ReceivedSeries& series) const {
  Rows rows = database_.query(
      "SELECT instance, coalesce(blob, ''), bytes FROM received WHERE route = ?1 AND study = ?2 "
      "AND series = ?3 ORDER BY instance",
      series.route, series.study, series.series);
  std::vector<ReceivedInstance> all;
  while (rows.next()) all.push_back({rows.text(0), rows.text(1), rows.count(2)});
  return all;
}

// If the connection is lost, a repetition returns no blobs; the released ones are swept.
std::vector<std::string> ReceivedStore::release(const HeldSeries& series) {
  const ReceivedSeries& of = series.series;
  const std::int64_t last = database_.to_us(series.last);
  using Blobs = std::vector<std::string>;
  return database_.change(Change::kNeeded, [&](SqlTransaction& transaction) -> Blobs {
    Blobs blobs;
    {
      Rows rows = transaction->query(
          std::string("SELECT blob, at FROM received WHERE route = ?1 AND study = ?2 AND series = "
                      "?3 AND blob IS NOT NULL ORDER BY instance") +
              transaction->for_update(),
          of.route, of.study, of.series);
      while (rows.next()) {
        if (rows.integer(1) > last) return {};
        blobs.push_back(rows.text(0));
      }
    }
    // Instances that arrived meanwhile are newer and stay.
    transaction->run(
        "UPDATE received SET blob = NULL, at = isomesh_kept(at) WHERE route = ?1 AND study = ?2 "
        "AND series = ?3 AND at <= ?4",
        of.route, of.study, of.series, last);
    transaction.commit();
    return blobs;
  });
}

std::size_t ReceivedStore::forget(Time before) {
  return database_.run(Change::kNeeded, "DELETE FROM received WHERE blob IS NULL AND at < ?1",
                       database_.to_us(before));
}

}  // namespace isomesh::store
