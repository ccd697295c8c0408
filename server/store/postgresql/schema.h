// The tables and functions of isomesh in PostgreSQL. Private to this folder.
#pragma once

#include "server/store/postgresql/connection.h"

namespace isomesh::store::postgresql {

// Creates missing tables and migrates those of an older version, in one transaction and by one
// process at a time. Retries for ten minutes while other sessions hold the tables; a statement may
// take as long. Throws Error kUnavailable if a newer version made them.
void migrate(Connection& connection);

// Throws Error unless this isomeshd can read the audit trail of these tables. Changes nothing.
void check_has_trail(Connection& connection);

// The SQL that creates the functions of the newest version.
extern const char* const kFunctions;

}  // namespace isomesh::store::postgresql
