#pragma once

#include <deque>
#include <functional>
#include <thread>
#include <vector>

#include "base/mutex.h"

namespace isomesh::net {

// Some threads and a bounded queue of tasks for them. Thread safe.
class BoundedTaskQueue {
 public:
  BoundedTaskQueue(std::size_t threads, std::size_t capacity);
  ~BoundedTaskQueue();
  BoundedTaskQueue(const BoundedTaskQueue&) = delete;
  BoundedTaskQueue& operator=(const BoundedTaskQueue&) = delete;

  // False, and nothing happens, when the queue is full or shut down. Never waits.
  bool try_enqueue(std::function<void()>&& task) ISOMESH_EXCLUDES(mutex_);

  // Tasks that were accepted are still run.
  void shutdown() ISOMESH_EXCLUDES(mutex_);

 private:
  void work() ISOMESH_EXCLUDES(mutex_);

  const std::size_t capacity_;
  Mutex mutex_;
  Condition changed_;
  std::deque<std::function<void()>> queue_ ISOMESH_GUARDED_BY(mutex_);
  bool closed_ ISOMESH_GUARDED_BY(mutex_) = false;
  std::vector<std::jthread> threads_;  // declared last, so that they end before what they use
};

}  // namespace isomesh::net
