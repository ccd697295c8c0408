// A pool of started processes.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <stop_token>
#include <thread>

#include "base/mutex.h"
#include "server/process/child.h"

namespace isomesh::process {

// Keeps `count` copies of a program that serves copies (fork_server.h). Thread safe.
class PreparedProcesses {
 public:
  PreparedProcesses(Program program, std::size_t count);
  // Ends the prepared processes. Taken ones also die with this object, whoever owns them.
  ~PreparedProcesses();
  PreparedProcesses(const PreparedProcesses&) = delete;
  PreparedProcesses& operator=(const PreparedProcesses&) = delete;

  // Takes a prepared process, which is then replaced, or waits for one. Skips processes that have
  // died. Retries failed starts, because a busy machine may recover. Throws Error kUnavailable if
  // there is none by `until`, and after stop(), and kCancelled after `cancelled`.
  Child take(std::chrono::steady_clock::time_point until, const std::stop_token& cancelled = {});

  // Call after input has crashed a process. Copies share addresses and stack guards. To prevent
  // guessing them, later copies come from a restarted program.
  void renew();

  // take() fails from now on.
  void stop();

 private:
  void keep(const std::stop_token& stop);
  void prepare_one(const std::stop_token& stop);
  Child copy(std::uint64_t generation, const std::stop_token& stop);

  const Program program_;
  const std::size_t count_;
  Mutex mutex_;
  Condition changed_;
  std::deque<Child> ready_ ISOMESH_GUARDED_BY(mutex_);
  std::size_t takers_ ISOMESH_GUARDED_BY(mutex_) = 0;        // waiting in take()
  std::uint64_t generation_ ISOMESH_GUARDED_BY(mutex_) = 0;  // of the program; incremented by
                                                             // renew()
  // Used on the keeper's thread only.
  std::optional<Child> server_;
  std::uint64_t server_generation_ = 0;
  std::stop_source stop_;
  std::jthread keeper_;  // last: it starts all processes, which die with it
};

}  // namespace isomesh::process
