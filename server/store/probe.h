#pragma once

#include <chrono>
#include <functional>

#include "base/mutex.h"

namespace isomesh::store {

// Health check for something that may hang. Runs one check at a time, and caches its result,
// because many threads may ask. Thread safe.
class Probe {
 public:
  // Returns the result of `ask`, or the last one if it is younger than `for_how_long` or a check is
  // running. False if the running check takes longer than `patience`.
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
  bool said_ ISOMESH_GUARDED_BY(mutex_) = true;  // before the first check
  // Begin or end of the last check.
  std::chrono::steady_clock::time_point last_ ISOMESH_GUARDED_BY(mutex_) = {};
};

}  // namespace isomesh::store
