#include "server/store/postgresql/outbox.h"

#include "proto/json.h"
#include "server/store/job_rules.h"

namespace isomesh::store::postgresql {
namespace {

// The stored record of a job, or what is sent if it is damaged: other deliveries must not wait.
Job job_of(const Delivery& delivery) {
  const auto job = readable_job(delivery.body, delivery.job);
  return job ? *job : damaged_job({.id = delivery.job, .state = JobState::kFailed});
}

}  // namespace

std::vector<Delivery> PostgresOutbox::due(Time now, std::size_t per_receiver) const {
  // Longer than a delivery takes.
  constexpr std::int64_t kHeldUs = std::int64_t{60} * 1'000'000;
  Rows rows = database_.query(
      "SELECT c.job, c.url, c.body, c.attempts, c.created, EXISTS(SELECT 1 FROM jobs j WHERE j.id "
      "= c.job) OR EXISTS(SELECT 1 FROM expired e WHERE e.id = c.job) FROM "
      "take_callbacks(?1::uuid, "
      "?2, ?3::int, ?4) c",
      database_.node(), database_.to_us(now), per_receiver, kHeldUs);
  std::vector<Delivery> deliveries;
  while (rows.next()) {
    Delivery& delivery = deliveries.emplace_back(delivery_of(rows));
    const bool is_job = rows.boolean(5);  // or it was one; orders do not expire
    if (is_job) delivery.body = to_json(job_of(delivery));
  }
  return deliveries;
}

void PostgresOutbox::postpone(const Delivery& delivery, Time next) {
  database_.run(Change::kRepeatable,
                "UPDATE callbacks SET attempts = attempts + 1, next = ?1, held_until = 0 WHERE job "
                "= ?2 AND created = ?3",
                database_.to_us(next), delivery.job, delivery.created_us);
}

}  // namespace isomesh::store::postgresql
