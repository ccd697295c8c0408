#pragma once

#include <atomic>
#include <string>

#include "server/store/believed_clock.h"
#include "server/store/blob_store.h"
#include "server/store/operators_word.h"
#include "server/store/postgresql/database.h"

namespace isomesh::store::postgresql {

// That the database and the store of blobs belong together, and which time it is: by the
// database's clock, as far as that can be believed. Both carry one name: a sweep after a mix-up
// would take everything that the database does not name, and a daemon with files of its own would
// not find those of the others. Thread safe; what it is made of must outlive it.
class Identity {
 public:
  // Throws Error kUnavailable when the one is not the other's and that was not allowed. Names both
  // where neither has a name.
  Identity(Database& database, const BlobStore& blobs, const OperatorsWord& word,
           std::chrono::milliseconds tolerance);
  // The same with another clock, which tells the database's time.
  Identity(Database& database, const BlobStore& blobs, const OperatorsWord& word,
           const BelievedClock::Options& clock);

  // By this machine's clock, as all times of the stores' interfaces are. Leaves a mark of it.
  Time now();

 private:
  // Of the database, in its own time.
  static Time last_seen(Database& database);

  Database& database_;
  BelievedClock clock_;
};

}  // namespace isomesh::store::postgresql
