#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "server/store/data_folder.h"
#include "server/store/sqlite.h"

namespace isomesh::store {

// The records of a data folder: one SQLite file (WAL, synchronous=FULL), with a connection that
// writes and one that reads, so that readers do not wait for the disk. Thread safe; `folder` must
// outlive it.
class Database {
 public:
  // Creates what is missing and brings what an older version left up to date. Throws Error
  // kUnavailable when a newer version made it, kOutOfSpace or kInternal.
  explicit Database(const DataFolder& folder);

  Connection& writer() { return writer_; }
  Connection& reader() { return reader_; }

  // Volumes of the version before databases whose records could not be read: left where they are,
  // for a person.
  const std::vector<std::string>& unreadable() const { return unreadable_; }

 private:
  void take_over_record_files(const DataFolder& folder);

  Connection writer_;
  Connection reader_;
  std::vector<std::string> unreadable_;  // constant after construction
};

// Microseconds since 1970: how the tables keep time.
std::int64_t now_us();

// The inverse of timestamp() of files.h; 0 for what is none.
std::int64_t us_of_timestamp(std::string_view text);

}  // namespace isomesh::store
