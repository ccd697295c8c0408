// The time, as far as it can be believed: what is kept must not expire because a clock was set.
#pragma once

#include <chrono>
#include <functional>

#include "base/mutex.h"
#include "server/store/expiry.h"

namespace isomesh::store {

// Follows the system's clock for as long as that agrees with the time that has passed. Where it
// does not, time goes on from where it was, at its own pace, until the clock is right again. It
// never goes back: what is used while a clock is behind would be the oldest of all once it is
// right. Thread safe.
class BelievedClock {
 public:
  using Steady = std::chrono::steady_clock::time_point;

  struct Options {
    std::chrono::milliseconds tolerance = std::chrono::days(7);  // how far ahead is still believed
    std::function<Time()> wall = [] { return std::chrono::system_clock::now(); };
    std::function<Steady()> steady = [] { return std::chrono::steady_clock::now(); };
    const char* name = "the clock";  // in the log
  };

  // `last_seen` is a time that has passed for certain.
  BelievedClock(Time last_seen, Options options);

  // Logs when the clock begins to be doubted.
  Time now();

  enum class Doubt {
    kNone,
    kAhead,   // further than is believed: it is not followed
    kBehind,  // by more than that
  };

  // How the system's clock was when now() was called last.
  Doubt doubt() const;

 private:
  void tell_doubt() const ISOMESH_REQUIRES(mutex_);

  const Options options_;
  mutable Mutex mutex_;
  Time believed_ ISOMESH_GUARDED_BY(mutex_);
  Steady since_ ISOMESH_GUARDED_BY(mutex_);
  Doubt doubt_ ISOMESH_GUARDED_BY(mutex_) = Doubt::kNone;
};

}  // namespace isomesh::store
