// Checks whether the service can take work, with a bounded response time.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <thread>

#include "base/mutex.h"

namespace isomesh::http {

// Thread safe. Starts on construction.
class Readiness {
 public:
  using Clock = std::chrono::steady_clock;
  struct Limits {
    std::chrono::milliseconds patience{30};         // how long reason() waits for a new check
    std::chrono::milliseconds believed_for{5'000};  // how long an old result is valid
  };

  // `check` returns the reason why the service takes no work; empty if it does. It may block; one
  // thread calls it. An exception is logged and means that nothing responds.
  explicit Readiness(std::function<std::string()> check) : Readiness(std::move(check), Limits()) {}
  Readiness(std::function<std::string()> check, const Limits& limits);
  // Waits for a running check.
  ~Readiness() = default;
  Readiness(const Readiness&) = delete;
  Readiness& operator=(const Readiness&) = delete;

  // Returns the reason why the service takes no work; empty if it does. The result is that of a
  // check that began after the call, if one ends in time, otherwise of the last one. If that is too
  // old, the reason is that nothing responds.
  std::string reason() ISOMESH_EXCLUDES(mutex_);

 private:
  void work(const std::stop_token& stop) ISOMESH_EXCLUDES(mutex_);

  const std::function<std::string()> check_;
  const Limits limits_;
  Mutex mutex_;
  Condition changed_;
  std::uint64_t asked_ ISOMESH_GUARDED_BY(mutex_) = 0;  // the newest check requested
  std::uint64_t begun_ ISOMESH_GUARDED_BY(mutex_) = 0;
  std::uint64_t ended_ ISOMESH_GUARDED_BY(mutex_) = 0;
  Clock::time_point began_at_ ISOMESH_GUARDED_BY(mutex_);
  Clock::time_point ended_at_ ISOMESH_GUARDED_BY(mutex_);
  std::string reason_ ISOMESH_GUARDED_BY(mutex_);
  std::jthread thread_;  // last, so that it ends before the members it uses
};

}  // namespace isomesh::http
