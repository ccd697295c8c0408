#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <stop_token>

#include "proto/error.h"

namespace isomesh::mesh {

// What a kernel needs from the job that it runs for; a default one cancels nothing and tells
// nobody. Kernels look at `stop` once per slab of layers and throw Error kCancelled; what they have
// written by then is indeterminate.
struct Context {
  std::stop_token stop;
  // Called from several threads with the share of the kernel's work that is done, 0..1.
  std::function<void(double)> progress;

  void throw_if_stopped() const {
    if (stop.stop_requested()) throw Error(ErrorCode::kCancelled, "the job was cancelled");
  }
};

// Calls body(task) for every task in [0, tasks), several at once, and returns when all are done.
// Looks at context.stop before each task and reports progress after it. An exception from a body
// ends the loop and is thrown on. Runs in the process's one arena; see set_thread_count.
void parallel_for(const Context& context, std::size_t tasks,
                  const std::function<void(std::size_t)>& body);

// The number of threads of the arena, at least 1. To be called while no kernel runs; the default is
// the number of processors.
void set_thread_count(int threads);
int thread_count();

}  // namespace isomesh::mesh
