// The tables and functions of isomesh in PostgreSQL. Private to this folder.
#pragma once

#include "server/store/postgresql/connection.h"

namespace isomesh::store::postgresql {

// Creates what is missing and brings the tables of an older version up to date, in one transaction
// and one process at a time. Throws Error kUnavailable when a newer version made them.
void migrate(Connection& connection);

}  // namespace isomesh::store::postgresql
