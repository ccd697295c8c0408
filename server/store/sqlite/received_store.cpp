#include "server/store/sqlite/received_store.h"

namespace isomesh::store {

void SqliteReceivedStore::add(const ReceivedSeries& series, const ReceivedInstance& instance) {
  Transaction transaction(database_.writer());
  transaction->run("INSERT OR REPLACE INTO received VALUES(?, ?, ?, ?, ?, ?, ?)", series.route,
                   series.study, series.series, instance.instance, instance.blob, instance.bytes,
                   now_us());
  transaction.commit();
}

std::vector<HeldSeries> SqliteReceivedStore::held() const {
  const Reading reading(database_.reader());
  Query rows = reading->query(
      "SELECT h.route, h.study, h.series, count(*), max(h.at), (SELECT count(*) FROM received k "
      "WHERE k.route = h.route AND k.study = h.study AND k.series = h.series) FROM received h "
      "WHERE h.blob IS NOT NULL GROUP BY 1, 2, 3");
  std::vector<HeldSeries> all;
  while (rows.next()) {
    all.push_back({.series = {rows.text(0), rows.text(1), rows.text(2)},
                   .held = static_cast<std::uint32_t>(rows.integer(3)),
                   .known = static_cast<std::uint32_t>(rows.integer(5)),
                   .last = from_us(rows.integer(4))});
  }
  return all;
}

std::uint64_t SqliteReceivedStore::held_bytes() const {
  const Reading reading(database_.reader());
  Query row = reading->query("SELECT coalesce(sum(bytes), 0) FROM received WHERE blob IS NOT NULL");
  row.next();
  return static_cast<std::uint64_t>(row.integer(0));
}

std::vector<ReceivedInstance> SqliteReceivedStore::instances(const ReceivedSeries& series) const {
  const Reading reading(database_.reader());
  Query rows = reading->query(
      "SELECT instance, coalesce(blob, ''), bytes FROM received WHERE route = ? AND study = ? AND "
      "series = ? ORDER BY instance",
      series.route, series.study, series.series);
  std::vector<ReceivedInstance> all;
  while (rows.next()) {
    all.push_back({rows.text(0), rows.text(1), static_cast<std::uint64_t>(rows.integer(2))});
  }
  return all;
}

std::vector<std::string> SqliteReceivedStore::release(const HeldSeries& series) {
  const ReceivedSeries& of = series.series;
  return database_.freeing([&]() -> std::vector<std::string> {
    Transaction transaction(database_.writer());
    std::vector<std::string> blobs;
    {
      Query rows = transaction->query(
          "SELECT blob, at FROM received WHERE route = ? AND study = ? AND series = ? AND blob IS "
          "NOT NULL",
          of.route, of.study, of.series);
      while (rows.next()) {
        if (rows.integer(1) > to_us(series.last)) return {};
        blobs.push_back(rows.text(0));
      }
    }
    transaction->run("UPDATE received SET blob = NULL WHERE route = ? AND study = ? AND series = ?",
                     of.route, of.study, of.series);
    transaction.commit();
    return blobs;
  });
}

std::size_t SqliteReceivedStore::forget(Time before) {
  return database_.freeing([&] {
    Transaction transaction(database_.writer());
    const int removed =
        transaction->run("DELETE FROM received WHERE blob IS NULL AND at < ?", to_us(before));
    transaction.commit();
    return static_cast<std::size_t>(removed);
  });
}

}  // namespace isomesh::store
