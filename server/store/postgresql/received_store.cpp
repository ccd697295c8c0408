#include "server/store/postgresql/received_store.h"

namespace isomesh::store::postgresql {

void PostgresReceivedStore::add(const ReceivedSeries& series, const ReceivedInstance& instance) {
  database_.run(
      "INSERT INTO received VALUES($1::text, $2::text, $3::text, $4::text, $5::text, $6::bigint, "
      "isomesh_now()) ON CONFLICT(route, study, series, instance) DO UPDATE SET blob = "
      "excluded.blob, bytes = excluded.bytes, at = excluded.at",
      series.route, series.study, series.series, instance.instance, instance.blob, instance.bytes);
}

std::vector<HeldSeries> PostgresReceivedStore::held() const {
  Rows rows = database_.run(
      "SELECT route, study, series, count(blob), max(at) FILTER (WHERE blob IS NOT NULL), count(*) "
      "FROM received GROUP BY 1, 2, 3 HAVING count(blob) > 0 ORDER BY 1, 2, 3");
  std::vector<HeldSeries> all;
  while (rows.next()) {
    all.push_back({.series = {rows.text(0), rows.text(1), rows.text(2)},
                   .held = static_cast<std::uint32_t>(rows.integer(3)),
                   .known = static_cast<std::uint32_t>(rows.integer(5)),
                   .last = database_.from_us(rows.integer(4))});
  }
  return all;
}

std::uint64_t PostgresReceivedStore::held_bytes() const {
  Rows row =
      database_.run("SELECT coalesce(sum(bytes), 0)::bigint FROM received WHERE blob IS NOT NULL");
  row.next();
  return static_cast<std::uint64_t>(row.integer(0));
}

std::vector<ReceivedInstance> PostgresReceivedStore::instances(const ReceivedSeries& series) const {
  Rows rows = database_.run(
      "SELECT instance, coalesce(blob, ''), bytes FROM received WHERE route = $1::text AND study = "
      "$2::text AND series = $3::text ORDER BY instance",
      series.route, series.study, series.series);
  std::vector<ReceivedInstance> all;
  while (rows.next()) {
    all.push_back({rows.text(0), rows.text(1), static_cast<std::uint64_t>(rows.integer(2))});
  }
  return all;
}

// Who asks again after a lost connection gets no blobs: those that were held are swept.
std::vector<std::string> PostgresReceivedStore::release(const HeldSeries& series) {
  const ReceivedSeries& of = series.series;
  return database_.ask([&](Connection& connection, bool) -> std::vector<std::string> {
    Transaction transaction(connection);
    Rows rows = transaction->run(
        "SELECT blob, at FROM received WHERE route = $1::text AND study = $2::text AND series = "
        "$3::text AND blob IS NOT NULL ORDER BY instance FOR UPDATE",
        of.route, of.study, of.series);
    std::vector<std::string> blobs;
    while (rows.next()) {
      if (rows.integer(1) > database_.to_us(series.last)) return {};
      blobs.push_back(rows.text(0));
    }
    // One that comes meanwhile is newer.
    transaction->run(
        "UPDATE received SET blob = NULL WHERE route = $1::text AND study = $2::text AND series = "
        "$3::text AND at <= $4::bigint",
        of.route, of.study, of.series, database_.to_us(series.last));
    transaction.commit();
    return blobs;
  });
}

std::size_t PostgresReceivedStore::forget(Time before) {
  return database_
      .run("DELETE FROM received WHERE blob IS NULL AND at < $1::bigint", database_.to_us(before))
      .changed();
}

}  // namespace isomesh::store::postgresql
