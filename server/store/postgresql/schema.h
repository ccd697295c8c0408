// The tables and functions of isomesh in PostgreSQL. Private to this folder.
#pragma once

#include <vector>

#include "server/store/postgresql/connection.h"
#include "server/store/sql/schema.h"

namespace isomesh::store::postgresql {

// The tables of the service, and those of the components.
std::vector<Schema> schemas_with(const std::vector<Schema>& components);

// Creates missing tables and upgrades those of an older version, in one transaction and by one
// process at a time. Retries for ten minutes while other sessions hold the tables; a statement may
// take as long. Throws as check_versions().
void upgrade(Connection& connection, const std::vector<Schema>& schemas);

// Throws Error kUnavailable as check_versions() of sql/schema.h does. Changes nothing.
void check_versions(Connection& connection, const std::vector<Schema>& components);

// The SQL that creates the functions of the newest version.
extern const char* const kFunctions;

}  // namespace isomesh::store::postgresql
