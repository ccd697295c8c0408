#include "server/store/postgresql/outbox.h"

#include "proto/json.h"

namespace isomesh::store::postgresql {

std::vector<Delivery> PostgresOutbox::due(Time now, std::size_t per_receiver) const {
  // Longer than a delivery takes.
  constexpr std::int64_t kHeldUs = std::int64_t{60} * 1'000'000;
  Rows rows = database_.query(
      "SELECT c.job, c.url, c.body, c.attempts, c.created, EXISTS(SELECT 1 FROM jobs j WHERE j.id "
      "= "
      "c.job) FROM take_callbacks(?1::uuid, ?2, ?3::int, ?4) c",
      database_.node(), database_.to_us(now), per_receiver, kHeldUs);
  std::vector<Delivery> deliveries;
  while (rows.next()) {
    Delivery& delivery = deliveries.emplace_back(delivery_of(rows));
    const bool is_job = rows.boolean(5);
    // Its body is the job's stored record.
    if (is_job) delivery.body = to_json(job_from_record(delivery.body));
  }
  return deliveries;
}

void PostgresOutbox::postpone(const std::string& job, Time next) {
  database_.run(
      Change::kRepeatable,
      "UPDATE callbacks SET attempts = attempts + 1, next = ?1, held_until = 0 WHERE job = ?2",
      database_.to_us(next), job);
}

}  // namespace isomesh::store::postgresql
