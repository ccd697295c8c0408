#pragma once

#include <chrono>
#include <functional>

#include "base/mutex.h"

namespace isomesh::store {

// Checks something that may hang. Runs one check at a time, and caches its result, because many
// threads may ask. Thread safe.
class HealthCheck {
 public:
  // Returns the result of `check`, or the last one if it is younger than `valid_for` or a check is
  // running. False if the running check takes longer than `patience`. If `check` throws, so does
  // this, and the result is false.
  bool passes(const std::function<bool()>& check,
              std::chrono::milliseconds valid_for = std::chrono::seconds(2),
              std::chrono::milliseconds patience = std::chrono::seconds(5)) {
    using Clock = std::chrono::steady_clock;
    {
      const Lock lock(mutex_);
      const auto age = Clock::now() - changed_;
      if (is_checking_) return last_ && age < patience;
      if (age < valid_for) return last_;
      is_checking_ = true;
      changed_ = Clock::now();
    }
    try {
      return end(check());
    } catch (...) {
      end(false);
      throw;
    }
  }

 private:
  bool end(bool result) {
    const Lock lock(mutex_);
    is_checking_ = false;
    changed_ = std::chrono::steady_clock::now();
    last_ = result;
    return result;
  }

  Mutex mutex_;
  bool is_checking_ ISOMESH_GUARDED_BY(mutex_) = false;
  bool last_ ISOMESH_GUARDED_BY(mutex_) = true;  // before the first check
  // Begin or end of the last check.
  std::chrono::steady_clock::time_point changed_ ISOMESH_GUARDED_BY(mutex_) = {};
};

}  // namespace isomesh::store
