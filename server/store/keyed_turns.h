#pragma once

#include <set>
#include <stop_token>
#include <string>
#include <utility>

#include "base/error.h"
#include "base/mutex.h"

namespace isomesh::store {

// Lets one thread at a time work on each key. Thread safe.
class KeyedTurns {
 public:
  // Has the turn for a key until destruction.
  class Turn {
   public:
    // Waits until no other thread has it. Throws Error kCancelled if `stop` is requested meanwhile.
    Turn(KeyedTurns& turns, std::string key, const std::stop_token& stop)
        : turns_(turns), key_(std::move(key)) {
      Lock lock(turns_.mutex_);
      const bool is_free = turns_.ended_.wait(lock, stop, [this]() ISOMESH_REQUIRES(turns_.mutex_) {
        return !turns_.taken_.contains(key_);
      });
      if (!is_free) throw Error(ErrorCode::kCancelled, "cancelled");
      turns_.taken_.insert(key_);
    }
    ~Turn() {
      const Lock lock(turns_.mutex_);
      turns_.taken_.erase(key_);
      turns_.ended_.notify_all();
    }
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;

   private:
    KeyedTurns& turns_;
    const std::string key_;
  };

 private:
  Mutex mutex_;
  Condition ended_;
  std::set<std::string> taken_ ISOMESH_GUARDED_BY(mutex_);
};

}  // namespace isomesh::store
