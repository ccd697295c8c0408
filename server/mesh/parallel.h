// Loops that run on several threads.
#pragma once

#include <cstddef>
#include <functional>

#include "server/mesh/context.h"

namespace isomesh::mesh {

// Calls body(task) for every task in [0, tasks), several at once, and returns when all are done.
// Looks at context.stop before each task and reports progress after it. An exception from a body
// ends the loop and is thrown on. All loops of the process share its threads; see set_thread_count.
void parallel_for(const Context& context, std::size_t tasks,
                  const std::function<void(std::size_t)>& body);

// While it lives, the loops that its thread begins run on that thread alone: with little to do,
// waking the others takes longer, and within a loop's task they have tasks of their own.
class OneThread {
 public:
  OneThread();
  ~OneThread();
  OneThread(const OneThread&) = delete;
  OneThread& operator=(const OneThread&) = delete;

 private:
  const bool before_;
};

// How many threads all loops share, at least 1; the default is the number of processors. To be
// called while no kernel runs.
void set_thread_count(int threads);
// 1 where OneThread says so.
int thread_count();

}  // namespace isomesh::mesh
