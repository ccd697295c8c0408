// Loops that run on several threads.
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>

#include "server/mesh/context.h"

namespace isomesh::mesh {

// Calls body(task) for every task in [0, tasks), several at once, and returns when all are done.
// Looks at context.stop before each task and reports progress after it. An exception from a body
// ends the loop and is thrown on. All loops of the process share its threads; see set_thread_count.
void parallel_for(const Context& context, std::size_t tasks,
                  const std::function<void(std::size_t)>& body);

inline constexpr std::size_t kChunk = 1 << 14;

inline std::size_t chunks_of(std::size_t count, std::size_t size = kChunk) {
  return (count + size - 1) / size;
}

// Calls body(begin, end) for the chunks of [0, count), several at once. Their size is fixed, so
// what is computed chunk by chunk does not depend on the number of threads.
template <class Body>
void for_chunks(const Context& context, std::size_t count, Body body, std::size_t size = kChunk) {
  parallel_for(context, chunks_of(count, size),
               [&](std::size_t chunk) { body(chunk * size, std::min(count, (chunk + 1) * size)); });
}

// Calls body(i) for each number in [0, count), chunk by chunk.
template <class Body>
void for_each(const Context& context, std::size_t count, Body body, std::size_t size = kChunk) {
  const auto run = [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) body(i);
  };
  for_chunks(context, count, run, size);
}

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
