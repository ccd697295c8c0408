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

// Some threads and a bounded queue of tasks for them. Several parties (see FairPlaces) share both:
// each has a share of the queue and of the threads, and their tasks take turns, so that whoever
// asks for much waits for itself. Thread safe.
class BoundedTaskQueue {
 public:
  using Task = std::function<void()>;

  // By `niceness` the threads are nicer than the process: of a busy machine they get less than
  // others.
  BoundedTaskQueue(std::size_t threads, std::size_t capacity, int niceness = 0);
  ~BoundedTaskQueue();
  BoundedTaskQueue(const BoundedTaskQueue&) = delete;
  BoundedTaskQueue& operator=(const BoundedTaskQueue&) = delete;

  // False, and nothing happens, when the queue or the party's share of it is full, or it is shut
  // down. Never waits.
  bool try_enqueue(const std::string& party, Task&& task) ISOMESH_EXCLUDES(mutex_);

  // The same for what goes on that was begun before: it has room always. False after shutdown.
  bool enqueue_rest(const std::string& party, Task&& task) ISOMESH_EXCLUDES(mutex_);

  // Tasks that were accepted are still run.
  void shutdown() ISOMESH_EXCLUDES(mutex_);

 private:
  struct Line {
    std::string party;
    std::deque<Task> tasks;
    std::size_t running = 0;
  };
  using Lines = std::list<Line>;  // that have tasks or run some; whose turn is next comes first

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
  std::vector<std::jthread> threads_;  // declared last, so that they end before what they use
};

}  // namespace isomesh::net
