// Tables of components, with a version each. For engines and for components with own tables.
#pragma once

#include <cstdint>
#include <span>
#include <string>
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
};

// The component that has what is not another's, and the blobs that its tables name.
inline constexpr const char* kService = "service";
inline constexpr const char* kBlobsOfService =
    "SELECT id AS blob, 'the volume ' AS what, id AS name FROM volumes UNION ALL "
    "SELECT blob, 'a mesh of the job ', job FROM meshes";

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
