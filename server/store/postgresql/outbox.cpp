#include "server/store/postgresql/outbox.h"

namespace isomesh::store::postgresql {

std::vector<Delivery> PostgresOutbox::due(Time now, std::size_t per_receiver) const {
  // Longer than a delivery takes.
  constexpr std::int64_t kHeldUs = std::int64_t{60} * 1'000'000;
  return deliveries_of(database_.query(
      "SELECT job, url, body, attempts, created FROM take_callbacks(?1::uuid, ?2, ?3::int, ?4)",
      database_.node(), database_.to_us(now), per_receiver, kHeldUs));
}

void PostgresOutbox::postpone(const std::string& job, Time next) {
  database_.run(
      Change::kRepeatable,
      "UPDATE callbacks SET attempts = attempts + 1, next = ?1, held_until = 0 WHERE job = ?2",
      database_.to_us(next), job);
}

}  // namespace isomesh::store::postgresql
