#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "server/store/files/data_folder.h"
#include "server/store/sql/schema.h"

namespace isomesh::store::postgresql {

struct Moved {
  std::uint64_t volumes = 0;
  std::uint64_t jobs = 0;
  // Rows of the first table of each component, by its name.
  std::map<std::string, std::uint64_t> others = {};

  bool operator==(const Moved&) const = default;
};

// Copies all records of an unused data folder to a database without records, all or nothing. From
// then on the folder's blobs belong to the database, and its records are ignored. Throws Error
// kInvalidParameter if the folder has no records or the database has some; kUnavailable or
// kInternal.
Moved move_records(const DataFolder& folder, const std::string& url,
                   const std::vector<Schema>& components);

}  // namespace isomesh::store::postgresql
