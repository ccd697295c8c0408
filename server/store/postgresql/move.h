#pragma once

#include <cstdint>
#include <string>

#include "server/store/files/data_folder.h"

namespace isomesh::store::postgresql {

// What was brought to a database.
struct Moved {
  std::uint64_t volumes = 0;
  std::uint64_t jobs = 0;
  std::uint64_t orders = 0;

  bool operator==(const Moved&) const = default;
};

// Brings all records of a data folder, which no daemon uses meanwhile, to a database that has none,
// all or nothing. The folder keeps its blobs, which belong to the database from then on, and its
// records, which nobody looks at any more. Throws Error kInvalidParameter where the folder has no
// records or the database has some, kUnavailable or kInternal.
Moved move_records(const DataFolder& folder, const std::string& url);

}  // namespace isomesh::store::postgresql
