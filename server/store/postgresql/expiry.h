// What the expiry of jobs and that of volumes share. Private to this folder.
#pragma once

#include <vector>

#include "server/store/expiry.h"
#include "server/store/postgresql/database.h"

namespace isomesh::store::postgresql {

// Of rows that are an owner, an id and when it was used last.
std::vector<Expirable> read_expirable(const Database& database, RecordKind kind, Rows rows);

// Of rows that are an owner and a sum of bytes.
OwnedBytes read_owned_bytes(Rows rows);

// What expire_job or expire_volume has answered: a row without a blob, then the blobs that nothing
// names any more; no rows where nothing has expired.
void add_expired(Rows rows, Expired& expired);

}  // namespace isomesh::store::postgresql
