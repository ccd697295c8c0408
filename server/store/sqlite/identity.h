#pragma once

#include <cstdint>
#include <string>

#include "base/mutex.h"
#include "server/store/believed_clock.h"
#include "server/store/blob_store.h"
#include "server/store/operator_overrides.h"
#include "server/store/sqlite/database.h"

namespace isomesh::store {

// Marks the records as moved to another database, whose blobs have that name if the records have
// none. Identity then refuses them: what they accepted would be lost there.
void mark_as_moved(Database& database, const std::string& name);

// Throws Error kUnavailable if the records are marked so. For commands that read them without
// Identity: they would copy or print an old state as if it were the present one.
void refuse_moved(Connection& connection);

// Ensures that the database and the blobs belong together, and provides a believed clock. Both
// carry the same name, and a number that grows as data is stored: after a mix-up, a sweep would
// remove all blobs that the database does not name. Thread safe; its dependencies must outlive it.
class Identity {
 public:
  // Throws Error kUnavailable if the two do not belong together, or one is older than the other,
  // and `overrides` does not allow that. Assigns a new name if it does, or if there is nothing to
  // lose yet.
  Identity(Database& database, BlobStore& blobs, const OperatorOverrides& overrides,
           const BelievedClock::Options& clock);

  // The believed time. Records it, and marks what was stored since the last mark; if the disk has
  // no space for that, the next call retries. Call about every minute.
  Time now();

 private:
  struct Mark {
    std::string id;  // empty: not marked yet
    std::int64_t number = 0;
    std::int64_t seen = 0;  // in the database's mark only: the believed time of the mark
  };

  static Time last_seen(Database& database, const BelievedClock::Options& clock);
  Mark mark_of_database() const;
  Mark mark_of_blobs() const;
  void check(const Mark& records, const Mark& blobs) const;
  void write_mark(Time time) ISOMESH_REQUIRES(mutex_);
  void write_blobs_mark() ISOMESH_REQUIRES(mutex_);

  Database& database_;
  BlobStore& blobs_;
  BelievedClock clock_;
  mutable Mutex mutex_;
  Mark mark_ ISOMESH_GUARDED_BY(mutex_);
  std::int64_t changes_ ISOMESH_GUARDED_BY(mutex_) = 0;  // of the database at the last mark
  // The mark of the blobs equals the database's.
  bool is_told_ ISOMESH_GUARDED_BY(mutex_) = false;
};

}  // namespace isomesh::store
