#include "server/store/sql/outbox.h"

#include <map>
#include <set>

#include "server/store/sql/undamaged_rows.h"

namespace isomesh::store {
namespace {

constexpr DamagedTable kCallbacks = {"callbacks", "SELECT body FROM callbacks", "job", "job DESC"};

}  // namespace

void add_callback(SqlConnection& connection, const std::string& id, const std::string& url,
                  const std::string& body) {
  connection.run(
      "INSERT INTO callbacks(job, receiver, url, body, attempts, created, next) VALUES(?1, ?2, ?3, "
      "?4, 0, isomesh_now(), isomesh_now()) ON CONFLICT(job) DO UPDATE SET body = excluded.body, "
      "attempts = 0, created = excluded.created, next = excluded.next",
      id, receiver_of(url), url, body);
}

std::vector<Delivery> SqlOutbox::due(Time now, std::size_t per_receiver) const {
  return list_despite_damage([&] { return first_due(now, per_receiver); },
                             [&] { return undamaged_due(now, per_receiver); });
}

std::vector<Delivery> SqlOutbox::first_due(Time now, std::size_t per_receiver) const {
  Rows rows = database_.query(
      "SELECT job, url, body, attempts, created FROM (SELECT *, row_number() OVER "
      "(PARTITION BY receiver ORDER BY next, job) AS place FROM callbacks WHERE next <= ?1 OR next "
      "> ?3) WHERE place <= ?2 ORDER BY next, job",
      database_.to_us(now), per_receiver, database_.to_us(now + kLongestPostponed));
  std::vector<Delivery> deliveries;
  while (rows.next()) deliveries.push_back(delivery_of(rows));
  return deliveries;
}

std::vector<Delivery> SqlOutbox::undamaged_due(Time now, std::size_t per_receiver) const {
  std::vector<Delivery> deliveries;
  std::set<std::string> taken;
  std::map<std::string, std::size_t> of_receiver;
  const auto take = [&](const Rows& rows) {
    if (!taken.insert(rows.text(0)).second || ++of_receiver[rows.text(5)] > per_receiver) return;
    deliveries.push_back(delivery_of(rows));
  };
  read_undamaged(database_, kCallbacks,
                 "SELECT job, url, body, attempts, created, receiver FROM callbacks WHERE (next <= "
                 "?1 OR next > ?2)",
                 take, database_.to_us(now), database_.to_us(now + kLongestPostponed));
  return deliveries;
}

Delivery SqlOutbox::delivery_of(const Rows& row) const {
  return {.job = row.text(0),
          .url = row.text(1),
          .body = row.text(2),
          .attempts = static_cast<int>(row.integer(3)),
          .created = database_.from_us(row.integer(4)),
          .created_us = row.integer(4)};
}

std::optional<Time> SqlOutbox::next_after(Time now) const {
  Rows row =
      database_.query("SELECT min(next) FROM callbacks WHERE next > ?1", database_.to_us(now));
  row.next();
  if (row.is_null(0)) return std::nullopt;
  return database_.from_us(row.integer(0));
}

void SqlOutbox::remove(const Delivery& delivery) {
  database_.run(Change::kRepeatable, "DELETE FROM callbacks WHERE job = ?1 AND created = ?2",
                delivery.job, delivery.created_us);
}

void SqlOutbox::postpone(const Delivery& delivery, Time next) {
  database_.run(
      Change::kRepeatable,
      "UPDATE callbacks SET attempts = attempts + 1, next = ?1 WHERE job = ?2 AND created = ?3",
      database_.to_us(next), delivery.job, delivery.created_us);
}

std::size_t SqlOutbox::count() const {
  Rows row = database_.query("SELECT count(*) FROM callbacks");
  row.next();
  return row.count(0);
}

}  // namespace isomesh::store
