// Effect of --trust-clock on records. For the identities of databases only.
#pragma once

#include <chrono>
#include <span>

#include "server/store/believed_clock.h"
#include "server/store/operator_overrides.h"
#include "server/store/sql/schema.h"

namespace isomesh::store {

// The start value of the believed clock: the last recorded time, or the clock's time if that is
// later and the operator trusts it.
Time time_to_start_with(Time last_seen, const OperatorOverrides& overrides,
                        const BelievedClock::Options& clock);

// Adjusts records after an operator has confirmed that this much time has passed. The clock may
// have been behind until then. So records used shortly before count as used now, and only those
// already old keep their age. Times are the database's; `tolerance` is the undetected error of its
// clock. Throws Error kOutOfSpace, kUnavailable or kInternal.
void trust(SqlDatabase& database, std::span<const Schema> schemas, Time last_seen, Time now,
           std::chrono::milliseconds tolerance);

}  // namespace isomesh::store
