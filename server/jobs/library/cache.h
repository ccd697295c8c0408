#pragma once

#include <cstddef>
#include <functional>
#include <future>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "base/mutex.h"
#include "proto/error.h"

namespace isomesh::jobs {

// Caches the results of slow computations that never change. Concurrent callers with the same key
// share one computation. Thread safe.
template <class Key, class Value>
class Cache {
 public:
  // Caches `capacity` results. At most `most_waiting` callers may compute a result or wait for one
  // at the same time.
  Cache(std::size_t capacity, std::size_t most_waiting)
      : capacity_(capacity), most_waiting_(most_waiting) {}

  // Returns the value of `key`, computed by `find` unless it is cached. Throws Error kUnavailable
  // if too many callers wait already. If `find` throws, all callers with that key get its exception
  // and nothing is cached.
  std::shared_ptr<const Value> get(const Key& key, const std::function<Value()>& find) {
    std::promise<std::shared_ptr<const Value>> promise;
    std::shared_future<std::shared_ptr<const Value>> result;
    bool is_mine = false;
    std::optional<Leave> leave;
    {
      const Lock lock(mutex_);
      if (const auto known = results_.find(key); known != results_.end()) {
        order_.splice(order_.begin(), order_, known->second.place);
        result = known->second.result;
      }
      const bool is_ready =
          result.valid() && result.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
      if (is_ready) return result.get();
      if (waiting_ >= most_waiting_) {
        throw Error(ErrorCode::kUnavailable, "too many requests of this kind are in progress");
      }
      ++waiting_;
      leave.emplace(*this);
      if (!result.valid()) {
        is_mine = true;
        result = promise.get_future().share();
        std::list<Key> place(1, key);
        results_.emplace(key, Entry{result, place.begin()});
        order_.splice(order_.begin(), place);
        forget_oldest();
      }
    }
    if (is_mine) fulfil(key, find, promise);
    return result.get();
  }

 private:
  struct Entry {
    std::shared_future<std::shared_ptr<const Value>> result;
    typename std::list<Key>::iterator place;
  };

  class Leave {
   public:
    explicit Leave(Cache& cache) : cache_(cache) {}
    ~Leave() {
      const Lock lock(cache_.mutex_);
      --cache_.waiting_;
    }
    Leave(const Leave&) = delete;
    Leave& operator=(const Leave&) = delete;

   private:
    Cache& cache_;
  };

  void fulfil(const Key& key, const std::function<Value()>& find,
              std::promise<std::shared_ptr<const Value>>& promise) {
    try {
      promise.set_value(std::make_shared<const Value>(find()));
    } catch (...) {
      promise.set_exception(std::current_exception());
      const Lock lock(mutex_);
      if (const auto failed = results_.find(key); failed != results_.end()) {
        order_.erase(failed->second.place);
        results_.erase(failed);
      }
    }
  }

  // Callers that still wait for the removed value hold its future themselves.
  void forget_oldest() ISOMESH_REQUIRES(mutex_) {
    while (order_.size() > capacity_) {
      results_.erase(order_.back());
      order_.pop_back();
    }
  }

  const std::size_t capacity_;
  const std::size_t most_waiting_;
  Mutex mutex_;
  std::list<Key> order_ ISOMESH_GUARDED_BY(mutex_);  // most recently used first
  std::map<Key, Entry> results_ ISOMESH_GUARDED_BY(mutex_);
  std::size_t waiting_ ISOMESH_GUARDED_BY(mutex_) = 0;
};

}  // namespace isomesh::jobs
