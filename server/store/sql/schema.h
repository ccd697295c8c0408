// Tables of components, with a version each. For engines and for components with own tables.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "server/store/sql/sql.h"

namespace isomesh::store {

// The tables of one component, which its own statements use.
struct Schema {
  std::string component;
  // Scripts: the tables of version 1, then the changes of each later version. Append only. In them
  // {key} is the type of a text that is a key, and {by_key} ends a table that is stored by its
  // primary key.
  std::vector<std::string> steps;
  // Copied by `isomeshd move` as they are, those that are referenced first.
  std::vector<std::string> tables = {};
  // A SELECT of the blobs that these tables name, in columns `blob`, `what` ("the volume ") and
  // `name`. They are kept, and copied by backups.
  std::string named_blobs = {};
  // Columns with the time from which a row is kept, each with its table. `--trust-clock` moves
  // them.
  std::vector<std::pair<std::string, std::string>> kept_from = {};
};

// The service's own tables, which `tables` creates, and then those of the components.
std::vector<Schema> with_service(std::string tables, std::vector<Schema> components);

// Throws Error kUnavailable if a newer isomeshd made the tables of one of these components, or if
// one without a schema here has tables. `place` begins the text: "the data folder".
void check_versions(SqlConnection& connection, const std::string& place,
                    std::span<const Schema> schemas);

// True if the tables of a component are missing or of an older version.
bool needs_upgrade(SqlConnection& connection, std::span<const Schema> schemas);

// Creates missing tables and changes those of an older version. For an open transaction.
void upgrade(SqlConnection& connection, std::span<const Schema> schemas);

// True if any record of a component names the blob.
bool is_named(SqlConnection& connection, const std::string& blob);

}  // namespace isomesh::store
