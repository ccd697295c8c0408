#pragma once

#include <cstddef>
#include <deque>
#include <functional>
#include <list>
#include <string>
#include <thread>
#include <vector>

#include "base/mutex.h"

namespace isomesh::net {

// Threads with a bounded queue of tasks. Parties (see FairPlaces) share both fairly, and their
// tasks alternate, so that a party with many tasks delays only itself. Thread safe.
class BoundedTaskQueue {
 public:
  using Task = std::function<void()>;

  // `niceness` lowers the threads' priority relative to the process.
  BoundedTaskQueue(std::size_t threads, std::size_t capacity, int niceness = 0);
  ~BoundedTaskQueue();
  BoundedTaskQueue(const BoundedTaskQueue&) = delete;
  BoundedTaskQueue& operator=(const BoundedTaskQueue&) = delete;

  // Returns false if the queue or the party's share of it is full, or after shutdown. Never blocks.
  bool try_enqueue(const std::string& party, Task&& task) ISOMESH_EXCLUDES(mutex_);

  // The same for the rest of an accepted task, which always has room. Returns false after shutdown.
  bool enqueue_rest(const std::string& party, Task&& task) ISOMESH_EXCLUDES(mutex_);

  // Accepted tasks still run.
  void shutdown() ISOMESH_EXCLUDES(mutex_);

 private:
  struct Line {
    std::string party;
    std::deque<Task> tasks;
    std::size_t running = 0;
  };
  using Lines = std::list<Line>;  // parties with tasks, queued or running; the next to be served
                                  // first

  void work() ISOMESH_EXCLUDES(mutex_);
  Lines::iterator line_of(const std::string& party) ISOMESH_REQUIRES(mutex_);
  void add(Lines::iterator line, Task&& task) ISOMESH_REQUIRES(mutex_);
  Lines::iterator next() ISOMESH_REQUIRES(mutex_);

  const std::size_t capacity_;
  Mutex mutex_;
  Condition changed_;
  Lines lines_ ISOMESH_GUARDED_BY(mutex_);
  std::size_t waiting_ ISOMESH_GUARDED_BY(mutex_) = 0;
  std::size_t idle_ ISOMESH_GUARDED_BY(mutex_);
  bool closed_ ISOMESH_GUARDED_BY(mutex_) = false;
  std::vector<std::jthread> threads_;  // last, so that they end before the members they use
};

}  // namespace isomesh::net
