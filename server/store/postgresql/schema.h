// The tables and functions of isomesh in PostgreSQL. Private to this folder.
#pragma once

#include "server/store/postgresql/connection.h"

namespace isomesh::store::postgresql {

// Creates missing tables and migrates those of an older version, in one transaction and by one
// process at a time. Throws Error kUnavailable if a newer version made them.
void migrate(Connection& connection);

// The SQL that creates the functions of the newest version.
extern const char* const kFunctions;

}  // namespace isomesh::store::postgresql
