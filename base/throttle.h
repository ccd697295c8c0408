// Limits how often something is told.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <utility>

#include "base/mutex.h"

namespace isomesh {

// Thread safe.
class Throttle {
 public:
  explicit Throttle(std::chrono::milliseconds pause) : pause_(pause) {}

  // The number of calls since the last permitted one if this one is permitted; otherwise empty.
  std::optional<std::uint64_t> permit() ISOMESH_EXCLUDES(mutex_) {
    const Lock lock(mutex_);
    const auto now = std::chrono::steady_clock::now();
    if (now < next_) {
      ++skipped_;
      return std::nullopt;
    }
    next_ = now + pause_;
    return std::exchange(skipped_, 0);
  }

 private:
  const std::chrono::milliseconds pause_;
  Mutex mutex_;
  std::chrono::steady_clock::time_point next_ ISOMESH_GUARDED_BY(mutex_);
  std::uint64_t skipped_ ISOMESH_GUARDED_BY(mutex_) = 0;
};

}  // namespace isomesh
