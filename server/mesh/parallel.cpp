#include "server/mesh/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

#include "base/mutex.h"

#ifdef ISOMESH_PARALLEL_TBB
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#endif

namespace isomesh::mesh {
namespace {

thread_local bool is_one_thread = false;

int default_thread_count() {
  return static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
}

// Runs one task of a loop and tells its context.
class Loop {
 public:
  Loop(const Context& context, std::size_t tasks, const std::function<void(std::size_t)>& body)
      : context_(context), tasks_(tasks), body_(body) {}

  void run(std::size_t task) {
    context_.throw_if_stopped();
    body_(task);
    const std::size_t done = done_.fetch_add(1, std::memory_order_relaxed) + 1;
    if (context_.progress) {
      context_.progress(static_cast<double>(done) / static_cast<double>(tasks_));
    }
  }

 private:
  const Context& context_;
  const std::size_t tasks_;
  const std::function<void(std::size_t)>& body_;
  std::atomic<std::size_t> done_ = 0;
};

#ifdef ISOMESH_PARALLEL_TBB

// oneTBB's arena, and the control that lets it have more threads than there are processors.
struct Arena {
  explicit Arena(int threads)
      : control(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(threads)),
        arena(threads) {}

  tbb::global_control control;
  tbb::task_arena arena;
};

std::unique_ptr<Arena>& arena() {
  static auto instance = std::make_unique<Arena>(default_thread_count());
  return instance;
}

void run_tasks(Loop& loop, std::size_t tasks) {
  arena()->arena.execute([&] {
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, tasks, 1),
        [&](const tbb::blocked_range<std::size_t>& range) {
          for (std::size_t task = range.begin(); task < range.end(); ++task) loop.run(task);
        },
        tbb::simple_partitioner());
  });
}

#else

std::atomic<int>& threads_setting() {
  static std::atomic<int> threads = default_thread_count();
  return threads;
}

// Plain threads that live as long as the loop, for the thread sanitizer, which cannot follow
// oneTBB.
void run_tasks(Loop& loop, std::size_t tasks) {
  std::atomic<std::size_t> next = 0;
  Mutex mutex;  // guards failure
  std::exception_ptr failure;
  const auto work = [&] {
    try {
      for (std::size_t task = next++; task < tasks; task = next++) loop.run(task);
    } catch (...) {
      next = tasks;
      const Lock lock(mutex);
      if (!failure) failure = std::current_exception();
    }
  };
  const auto threads = std::min(static_cast<std::size_t>(threads_setting()), tasks);
  {
    std::vector<std::jthread> others;
    for (std::size_t i = 1; i < threads; ++i) others.emplace_back(work);
    work();
  }
  if (failure) std::rethrow_exception(failure);
}

#endif

}  // namespace

void parallel_for(const Context& context, std::size_t tasks,
                  const std::function<void(std::size_t)>& body) {
  if (tasks == 0) return context.throw_if_stopped();
  Loop loop(context, tasks, body);
  if (!is_one_thread && tasks > 1) return run_tasks(loop, tasks);
  for (std::size_t task = 0; task < tasks; ++task) loop.run(task);
}

OneThread::OneThread() : before_(std::exchange(is_one_thread, true)) {}
OneThread::~OneThread() { is_one_thread = before_; }

#ifdef ISOMESH_PARALLEL_TBB

void set_thread_count(int threads) {
  arena().reset();
  arena() = std::make_unique<Arena>(std::max(1, threads));
}

int thread_count() { return is_one_thread ? 1 : arena()->arena.max_concurrency(); }

#else

void set_thread_count(int threads) { threads_setting() = std::max(1, threads); }

int thread_count() { return is_one_thread ? 1 : threads_setting().load(); }

#endif

}  // namespace isomesh::mesh
