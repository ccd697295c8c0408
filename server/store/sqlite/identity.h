#pragma once

#include <cstdint>
#include <string>

#include "base/mutex.h"
#include "server/store/believed_clock.h"
#include "server/store/blob_store.h"
#include "server/store/operators_word.h"
#include "server/store/sqlite/database.h"

namespace isomesh::store {

// That the database and the store of blobs belong together, and which time it is. Both
// carry one name, and a number that grows with what is stored: a sweep after a mix-up would take
// everything that the database does not name. Thread safe; what it is made of must outlive it.
class Identity {
 public:
  // Throws Error kUnavailable when the one is not the other's, or older than it, and that was not
  // allowed. Names both anew where it was, or where there is nothing to lose yet.
  Identity(Database& database, const BlobStore& blobs, const OperatorsWord& word,
           const BelievedClock::Options& clock);

  // The time as far as the clock can be believed. Leaves a mark of it and of what was stored since
  // the last mark, or the next time when the disk has no room for that. To be called every minute
  // or so.
  Time now();

  // Whether the clock says quite another time than that.
  bool doubts_clock() const { return clock_.doubt() != BelievedClock::Doubt::kNone; }

 private:
  struct Mark {
    std::string id;  // empty: not marked yet
    std::int64_t number = 0;
    std::int64_t seen = 0;  // of the database's: the believed time when it was made
  };

  static Time last_seen(Database& database, const BelievedClock::Options& clock);
  Mark mark_of_database() const;
  Mark mark_of_blobs() const;
  void check(const Mark& records, const Mark& blobs) const;
  void write_mark(Time time) ISOMESH_REQUIRES(mutex_);
  void write_blobs_mark() ISOMESH_REQUIRES(mutex_);

  Database& database_;
  const BlobStore& blobs_;
  BelievedClock clock_;
  mutable Mutex mutex_;
  Mark mark_ ISOMESH_GUARDED_BY(mutex_);
  std::int64_t changes_ ISOMESH_GUARDED_BY(mutex_) = 0;  // of the database when it was made
  bool is_told_ ISOMESH_GUARDED_BY(mutex_) = false;      // the blobs' mark is the database's
};

}  // namespace isomesh::store
