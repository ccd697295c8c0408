// The time, as far as it can be believed: what is kept must not expire because a clock was set.
#pragma once

#include <chrono>
#include <functional>

#include "base/mutex.h"
#include "server/store/expiry.h"

namespace isomesh::store {

// Follows the system's clock for as long as that agrees with the time that has passed. A clock that
// is further ahead is not believed: then time goes on from where it was, at its own pace, until the
// clock is right again. A clock that is behind only makes things be kept for longer, and is
// followed. Thread safe.
class BelievedClock {
 public:
  using Steady = std::chrono::steady_clock::time_point;

  struct Options {
    std::chrono::milliseconds tolerance = std::chrono::days(7);  // how far ahead is still believed
    std::function<Time()> wall = [] { return std::chrono::system_clock::now(); };
    std::function<Steady()> steady = [] { return std::chrono::steady_clock::now(); };
  };

  // `last_seen` is a time that has passed for certain.
  BelievedClock(Time last_seen, Options options);

  Time now();

  // Whether the system's clock was not believed when now() was called last.
  bool is_doubted() const;

 private:
  const Options options_;
  mutable Mutex mutex_;
  Time believed_ ISOMESH_GUARDED_BY(mutex_);
  Steady since_ ISOMESH_GUARDED_BY(mutex_);
  bool is_doubted_ ISOMESH_GUARDED_BY(mutex_) = false;
};

}  // namespace isomesh::store
