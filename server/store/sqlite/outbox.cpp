#include "server/store/sqlite/outbox.h"

#include "proto/json.h"

namespace isomesh::store {

void SqliteOutbox::add(Connection& connection, const Job& job) {
  if (!job.parameters.callback) return;
  add(connection, job.id, job.parameters.callback->url, to_json(job));
}

void SqliteOutbox::add(Connection& connection, const std::string& id, const std::string& url,
                       const std::string& body) {
  connection.run("INSERT OR REPLACE INTO callbacks VALUES(?, ?, ?, ?, 0, ?, ?)", id,
                 receiver_of(url), url, body, now_us(), now_us());
}

std::vector<Delivery> SqliteOutbox::due(Time now, std::size_t per_receiver) const {
  const Reading reading(database_.reader());
  Query rows = reading->query(
      "SELECT job, url, body, attempts, created FROM (SELECT *, row_number() OVER "
      "(PARTITION BY receiver ORDER BY next, job) AS place FROM callbacks WHERE next <= ?) "
      "WHERE place <= ? ORDER BY next, job",
      to_us(now), per_receiver);
  std::vector<Delivery> result;
  while (rows.next()) {
    result.push_back({.job = rows.text(0),
                      .url = rows.text(1),
                      .body = rows.text(2),
                      .attempts = static_cast<int>(rows.integer(3)),
                      .created = from_us(rows.integer(4))});
  }
  return result;
}

std::optional<Time> SqliteOutbox::next_after(Time now) const {
  const Reading reading(database_.reader());
  Query row = reading->query("SELECT min(next) FROM callbacks WHERE next > ?", to_us(now));
  if (!row.next() || row.is_null(0)) return std::nullopt;
  return from_us(row.integer(0));
}

void SqliteOutbox::remove(const std::string& job) {
  database_.freeing([&] {
    Transaction transaction(database_.writer(), Durability::kProcess);
    transaction->run("DELETE FROM callbacks WHERE job = ?", job);
    transaction.commit();
  });
}

void SqliteOutbox::postpone(const std::string& job, Time next) {
  database_.freeing([&] {
    Transaction transaction(database_.writer(), Durability::kProcess);
    transaction->run("UPDATE callbacks SET attempts = attempts + 1, next = ? WHERE job = ?",
                     to_us(next), job);
    transaction.commit();
  });
}

std::size_t SqliteOutbox::count() const {
  const Reading reading(database_.reader());
  Query row = reading->query("SELECT count(*) FROM callbacks");
  return row.next() ? static_cast<std::size_t>(row.integer(0)) : 0;
}

}  // namespace isomesh::store
