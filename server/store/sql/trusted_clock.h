// What --trust-clock means to records. For identities of databases only.
#pragma once

#include <chrono>

#include "server/store/believed_clock.h"
#include "server/store/operators_word.h"
#include "server/store/sql/sql.h"

namespace isomesh::store {

// For the believed clock: the last time that was seen, or what the clock says if that is trusted.
Time time_to_start_with(Time last_seen, const OperatorsWord& word,
                        const BelievedClock::Options& clock);

// An operator says that so much time has passed. Records cannot tell whether it has: the clock may
// have been behind until then. So what was used shortly before counts as used now, and only what
// was old already is as old as the clock says. Times are the database's; `tolerance` is by how much
// its clock may be wrong unnoticed. Throws Error kOutOfSpace, kUnavailable or kInternal.
void trust(SqlDatabase& database, Time last_seen, Time now, std::chrono::milliseconds tolerance);

}  // namespace isomesh::store
