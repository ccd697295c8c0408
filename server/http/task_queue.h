#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include <httplib.h>

namespace isomesh::http {

// The library's pool grows its queue without end. This one holds the accepting thread back when its
// queue is full, so that connections wait in the system's backlog, which is bounded. Thread safe.
class BoundedTaskQueue : public httplib::TaskQueue {
 public:
  BoundedTaskQueue(std::size_t threads, std::size_t capacity);
  ~BoundedTaskQueue() override;

  void enqueue(std::function<void()> task) override;

  // Tasks that were accepted are still run.
  void shutdown() override;

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
