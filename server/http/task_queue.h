#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace isomesh::http {

// A number of threads and a bounded queue before them. Thread safe.
class BoundedTaskQueue {
 public:
  BoundedTaskQueue(std::size_t threads, std::size_t capacity);
  ~BoundedTaskQueue();
  BoundedTaskQueue(const BoundedTaskQueue&) = delete;
  BoundedTaskQueue& operator=(const BoundedTaskQueue&) = delete;

  // False, and nothing happens, when the queue is full or shut down. Never waits.
  bool try_enqueue(std::function<void()>&& task);

  // Tasks that were accepted are still run.
  void shutdown();

 private:
  void work();

  const std::size_t capacity_;
  std::mutex mutex_;  // guards the queue and closed_
  std::condition_variable changed_;
  std::deque<std::function<void()>> queue_;
  bool closed_ = false;
  std::vector<std::jthread> threads_;  // last: joined first
};

}  // namespace isomesh::http
