#include "server/store/sql/trusted_clock.h"

#include <algorithm>

#include "base/log.h"
#include "server/store/microseconds.h"

namespace isomesh::store {

Time time_to_start_with(Time last_seen, const OperatorOverrides& overrides,
                        const BelievedClock::Options& clock) {
  return overrides.trust_clock ? std::max(last_seen, clock.wall()) : last_seen;
}

void trust(SqlDatabase& database, Time last_seen, Time now, std::chrono::milliseconds tolerance) {
  if (now <= last_seen + tolerance) return;
  const std::int64_t since = to_us(last_seen - 2 * tolerance);
  const std::size_t kept = database.change(Change::kNeeded, [&](SqlTransaction& transaction) {
    std::size_t count = 0;
    for (const char* sql :
         {"UPDATE volumes SET used = ?2 WHERE used >= ?1 AND used < ?2",
          "UPDATE jobs SET finished = ?2 WHERE finished >= ?1 AND finished < ?2",
          "UPDATE orders SET finished = ?2 WHERE finished >= ?1 AND finished < ?2"}) {
      count += transaction->run(sql, since, to_us(now));
    }
    transaction.commit();
    return count;
  });
  log_warning("--trust-clock: {} records that were used shortly before count as used now", kept);
}

}  // namespace isomesh::store
