#pragma once

#include <cstddef>
#include <functional>
#include <future>
#include <list>
#include <map>
#include <memory>
#include <utility>

#include "base/mutex.h"
#include "proto/error.h"

namespace isomesh::jobs {

// Keeps the last answers to questions that take long to answer and whose answers never change. A
// question that several callers ask at the same time is answered once, for all of them. Thread
// safe.
template <class Key, class Value>
class Memo {
 public:
  // Keeps `capacity` answers, and lets at most `most_waiting` callers at a time find an answer or
  // wait for another caller to find it.
  Memo(std::size_t capacity, std::size_t most_waiting)
      : capacity_(capacity), most_waiting_(most_waiting) {}

  // The answer to `key`, which `find` finds when it is not kept. Throws Error kUnavailable when too
  // many callers wait already, and what `find` throws; then nothing is kept.
  std::shared_ptr<const Value> get(const Key& key, const std::function<Value()>& find) {
    std::promise<std::shared_ptr<const Value>> promise;
    std::shared_future<std::shared_ptr<const Value>> answer;
    bool is_mine = false;
    {
      const Lock lock(mutex_);
      if (const auto known = answers_.find(key); known != answers_.end()) {
        order_.splice(order_.begin(), order_, known->second.place);
        answer = known->second.answer;
      }
      const bool is_ready =
          answer.valid() && answer.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
      if (is_ready) return answer.get();
      if (waiting_ >= most_waiting_) {
        throw Error(ErrorCode::kUnavailable, "too many requests of this kind are in progress");
      }
      ++waiting_;
      if (!answer.valid()) {
        is_mine = true;
        answer = promise.get_future().share();
        order_.push_front(key);
        answers_.emplace(key, Entry{answer, order_.begin()});
        forget_oldest();
      }
    }
    const Leave leave(*this);
    if (is_mine) fulfil(key, find, promise);
    return answer.get();
  }

 private:
  struct Entry {
    std::shared_future<std::shared_ptr<const Value>> answer;
    typename std::list<Key>::iterator place;
  };

  // Gives a caller's place among those that wait back when it goes.
  class Leave {
   public:
    explicit Leave(Memo& memo) : memo_(memo) {}
    ~Leave() {
      const Lock lock(memo_.mutex_);
      --memo_.waiting_;
    }
    Leave(const Leave&) = delete;
    Leave& operator=(const Leave&) = delete;

   private:
    Memo& memo_;
  };

  void fulfil(const Key& key, const std::function<Value()>& find,
              std::promise<std::shared_ptr<const Value>>& promise) {
    try {
      promise.set_value(std::make_shared<const Value>(find()));
    } catch (...) {
      promise.set_exception(std::current_exception());
      const Lock lock(mutex_);
      if (const auto failed = answers_.find(key); failed != answers_.end()) {
        order_.erase(failed->second.place);
        answers_.erase(failed);
      }
    }
  }

  // Callers that still wait for an answer that is forgotten hold its future themselves.
  void forget_oldest() ISOMESH_REQUIRES(mutex_) {
    while (order_.size() > capacity_) {
      answers_.erase(order_.back());
      order_.pop_back();
    }
  }

  const std::size_t capacity_;
  const std::size_t most_waiting_;
  Mutex mutex_;
  std::list<Key> order_ ISOMESH_GUARDED_BY(mutex_);  // the last asked for first
  std::map<Key, Entry> answers_ ISOMESH_GUARDED_BY(mutex_);
  std::size_t waiting_ ISOMESH_GUARDED_BY(mutex_) = 0;
};

}  // namespace isomesh::jobs
