#include "server/store/postgresql/outbox.h"

namespace isomesh::store::postgresql {
namespace {

// Longer than a delivery takes.
constexpr std::int64_t kHeldUs = std::int64_t{60} * 1'000'000;

}  // namespace

std::vector<Delivery> PostgresOutbox::due(Time now, std::size_t per_receiver) const {
  Rows rows = database_.run(
      "SELECT job, url, body, attempts, created FROM take_callbacks($1::uuid, $2::bigint, $3::int, "
      "$4::bigint)",
      database_.node(), database_.to_us(now), per_receiver, kHeldUs);
  std::vector<Delivery> result;
  while (rows.next()) {
    result.push_back({.job = rows.text(0),
                      .url = rows.text(1),
                      .body = rows.text(2),
                      .attempts = static_cast<int>(rows.integer(3)),
                      .created = database_.from_us(rows.integer(4))});
  }
  return result;
}

std::optional<Time> PostgresOutbox::next_after(Time now) const {
  Rows row = database_.run("SELECT min(next) FROM callbacks WHERE next > $1::bigint",
                           database_.to_us(now));
  row.next();
  if (row.is_null(0)) return std::nullopt;
  return database_.from_us(row.integer(0));
}

void PostgresOutbox::remove(const std::string& job) {
  database_.run("DELETE FROM callbacks WHERE job = $1::text", job);
}

void PostgresOutbox::postpone(const std::string& job, Time next) {
  database_.run(
      "UPDATE callbacks SET attempts = attempts + 1, next = $2::bigint, held_until = 0 WHERE job = "
      "$1::text",
      job, database_.to_us(next));
}

std::size_t PostgresOutbox::count() const {
  Rows row = database_.run("SELECT count(*) FROM callbacks");
  row.next();
  return static_cast<std::size_t>(row.integer(0));
}

}  // namespace isomesh::store::postgresql
