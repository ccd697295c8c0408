#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace isomesh::http {

// Some more than there are processors: one of them may wait for the disk for a moment.
std::size_t usual_prompt_threads();

// A number of threads and a bounded queue before them. Tasks are begun at once by the first few
// threads; the others take those that have waited for some milliseconds because tasks before them
// wait for something. So short tasks do not take turns on the processors, each waiting for all
// others in the midst of its work. Thread safe.
class BoundedTaskQueue {
 public:
  // `prompt`: how many tasks may be under way when one is begun at once; at least 1.
  BoundedTaskQueue(std::size_t threads, std::size_t capacity,
                   std::size_t prompt = usual_prompt_threads());
  ~BoundedTaskQueue();
  BoundedTaskQueue(const BoundedTaskQueue&) = delete;
  BoundedTaskQueue& operator=(const BoundedTaskQueue&) = delete;

  // False, and nothing happens, when the queue is full or shut down. Never waits.
  bool try_enqueue(std::function<void()>&& task);

  // Tasks that were accepted are still run.
  void shutdown();

 private:
  using Clock = std::chrono::steady_clock;

  struct Task {
    std::function<void()> run;
    Clock::time_point due;  // when it is begun however many are under way
  };

  void work();

  const std::size_t capacity_;
  const std::size_t prompt_;
  std::mutex mutex_;  // guards what follows, but for the threads
  std::condition_variable changed_;
  std::deque<Task> queue_;
  std::size_t under_way_ = 0;
  bool is_watched_ = false;  // an idle thread wakes when the first task is due
  bool closed_ = false;
  std::vector<std::jthread> threads_;  // last: joined first
};

}  // namespace isomesh::http
