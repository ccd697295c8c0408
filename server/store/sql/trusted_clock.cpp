#include "server/store/sql/trusted_clock.h"

#include <algorithm>

#include "base/log.h"
#include "server/store/microseconds.h"

namespace isomesh::store {

Time time_to_start_with(Time last_seen, const OperatorOverrides& overrides,
                        const BelievedClock::Options& clock) {
  return overrides.trust_clock ? std::max(last_seen, clock.wall()) : last_seen;
}

void trust(SqlDatabase& database, std::span<const Schema> schemas, Time last_seen, Time now,
           std::chrono::milliseconds tolerance) {
  if (now <= last_seen + tolerance) return;
  const std::int64_t since = to_us(last_seen - 2 * tolerance);
  const std::size_t kept = database.change(Change::kNeeded, [&](SqlTransaction& transaction) {
    std::size_t count = 0;
    for (const Schema& schema : schemas) {
      for (const auto& [table, column] : schema.kept_from) {
        count += transaction->run("UPDATE " + table + " SET " + column + " = ?2 WHERE " + column +
                                      " >= ?1 AND " + column + " < ?2",
                                  since, to_us(now));
      }
    }
    transaction.commit();
    return count;
  });
  log_warning("--trust-clock: {} records that were used shortly before count as used now", kept);
}

}  // namespace isomesh::store
