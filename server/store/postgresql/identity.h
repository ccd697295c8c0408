#pragma once

#include <atomic>
#include <string>

#include "server/store/believed_clock.h"
#include "server/store/blob_store.h"
#include "server/store/operator_overrides.h"
#include "server/store/postgresql/database.h"

namespace isomesh::store::postgresql {

// Ensures that the database and the blobs belong together, and provides a believed clock based on
// the database's. Both carry one name: after a mix-up, a sweep would remove all blobs that the
// database does not name, and a daemon with its own files would miss those of others. Thread safe;
// its dependencies must outlive it.
class Identity {
 public:
  // Names both if neither has a name. Throws Error kUnavailable if they do not belong together and
  // `overrides` does not allow that.
  Identity(Database& database, BlobStore& blobs, const OperatorOverrides& overrides,
           std::chrono::milliseconds tolerance);
  // As above, with another clock for the database's time.
  Identity(Database& database, BlobStore& blobs, const OperatorOverrides& overrides,
           const BelievedClock::Options& clock);

  // The believed time, converted to this machine's clock as the interfaces of stores require.
  // Records it in the database.
  Time now();

 private:
  // The last recorded time, by the database's clock.
  static Time last_seen(Database& database);

  Database& database_;
  BelievedClock clock_;
};

}  // namespace isomesh::store::postgresql
