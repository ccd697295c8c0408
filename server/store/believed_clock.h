// A clock that does not let data expire because the system's clock was set wrongly.
#pragma once

#include <chrono>
#include <functional>

#include "base/mutex.h"
#include "server/store/expiry.h"

namespace isomesh::store {

// Follows the system's clock while that agrees with the time elapsed on the steady clock. Otherwise
// it advances at the steady clock's pace until the system's clock is right again. It never goes
// back: records used while a clock is behind would be the oldest ones once it is right. Thread
// safe.
class BelievedClock {
 public:
  using Steady = std::chrono::steady_clock::time_point;

  struct Options {
    // Largest deviation that is not doubted.
    std::chrono::milliseconds tolerance = std::chrono::days(7);
    std::function<Time()> wall = [] { return std::chrono::system_clock::now(); };
    std::function<Steady()> steady = [] { return std::chrono::steady_clock::now(); };
    const char* name = "the clock";  // in the log
  };

  // `last_seen` is a time known to be in the past.
  BelievedClock(Time last_seen, Options options);

  // Logs when doubts about the clock begin.
  Time now();

  enum class Doubt {
    kNone,
    kAhead,   // beyond the tolerance; not followed
    kBehind,  // behind by more than the tolerance
  };

  // The state of the system's clock at the last call of now().
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
