// Processes that are kept started, so that nobody waits for that.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <optional>
#include <thread>

#include "base/mutex.h"
#include "server/process/child.h"

namespace isomesh::process {

// Keeps `count` copies of a program that serves copies (fork_server.h). Thread safe.
class PreparedProcesses {
 public:
  PreparedProcesses(const std::filesystem::path& program, std::size_t count);
  // Ends those that are prepared. Those that were taken die with this object too, whoever holds
  // them.
  ~PreparedProcesses();
  PreparedProcesses(const PreparedProcesses&) = delete;
  PreparedProcesses& operator=(const PreparedProcesses&) = delete;

  // One that has been prepared, which another replaces, or waits for one where there is none. Those
  // that have died meanwhile are passed over. A start that fails is repeated: what a busy machine
  // refuses now it may allow soon. Throws Error kInternal when there is none by `until`, and
  // kUnavailable once stopped.
  Child take(std::chrono::steady_clock::time_point until);

  // To be called when one was ended by what it had to read. Copies have their addresses and stack
  // guards in common; so that nobody finds them out by trying, the next ones are made of a program
  // that is started anew.
  void renew();

  // take() is refused from now on.
  void stop();

 private:
  void keep(const std::stop_token& stop);
  void prepare_one(const std::stop_token& stop);
  Child copy(std::uint64_t generation, const std::stop_token& stop);

  const std::filesystem::path program_;
  const std::size_t count_;
  Mutex mutex_;
  Condition changed_;
  std::deque<Child> ready_ ISOMESH_GUARDED_BY(mutex_);
  std::size_t takers_ ISOMESH_GUARDED_BY(mutex_) = 0;        // that wait
  std::uint64_t generation_ ISOMESH_GUARDED_BY(mutex_) = 0;  // of the program: grows with renew()
  // Used by the keeper alone.
  std::optional<Child> server_;
  std::uint64_t server_generation_ = 0;
  std::stop_source stop_;
  std::jthread keeper_;  // last: it starts all processes, which die with it
};

}  // namespace isomesh::process
