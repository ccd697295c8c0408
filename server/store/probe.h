#pragma once

#include <chrono>
#include <functional>

#include "base/mutex.h"

namespace isomesh::store {

// Asks something that may hang, at most once at a time and now and then: many threads may want to
// know. Thread safe.
class Probe {
 public:
  // What `ask` says, or has said less than `for_how_long` ago. False while somebody waits for it
  // for longer than `patience`.
  bool answers(std::chrono::milliseconds for_how_long, std::chrono::milliseconds patience,
               const std::function<bool()>& ask) {
    using Clock = std::chrono::steady_clock;
    {
      const Lock lock(mutex_);
      const auto age = Clock::now() - last_;
      if (is_asking_) return said_ && age < patience;
      if (age < for_how_long) return said_;
      is_asking_ = true;
      last_ = Clock::now();
    }
    const bool says = ask();
    const Lock lock(mutex_);
    is_asking_ = false;
    last_ = Clock::now();
    said_ = says;
    return says;
  }

 private:
  Mutex mutex_;
  bool is_asking_ ISOMESH_GUARDED_BY(mutex_) = false;
  bool said_ ISOMESH_GUARDED_BY(mutex_) = true;  // before it was asked the first time
  std::chrono::steady_clock::time_point last_ ISOMESH_GUARDED_BY(mutex_) = {};  // begun or ended
};

}  // namespace isomesh::store
