// Whether the service can take work, told in time however long the answer takes to find.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <thread>

#include "base/mutex.h"

namespace isomesh::http {

// Thread safe. Begins with its construction.
class Readiness {
 public:
  using Clock = std::chrono::steady_clock;
  struct Limits {
    std::chrono::milliseconds patience{30};         // how long reason() waits for what it asked for
    std::chrono::milliseconds believed_for{5'000};  // how long an answer counts without a newer one
  };

  // `check` returns why the service takes no work, empty when it does. It may block, and is called
  // by one thread. What it throws is logged, and the reason is that nothing responds.
  explicit Readiness(std::function<std::string()> check) : Readiness(std::move(check), Limits()) {}
  Readiness(std::function<std::string()> check, const Limits& limits);
  // Waits for a check that is under way.
  ~Readiness() = default;
  Readiness(const Readiness&) = delete;
  Readiness& operator=(const Readiness&) = delete;

  // Why the service takes no work; empty when it does. Found by a check that began after the call
  // where one ends in time, else by the last one; when that is too long ago, the reason is that
  // nothing responds.
  std::string reason() ISOMESH_EXCLUDES(mutex_);

 private:
  void work(const std::stop_token& stop) ISOMESH_EXCLUDES(mutex_);

  const std::function<std::string()> check_;
  const Limits limits_;
  Mutex mutex_;
  Condition changed_;
  std::uint64_t asked_ ISOMESH_GUARDED_BY(mutex_) = 0;  // the newest check that somebody wants
  std::uint64_t begun_ ISOMESH_GUARDED_BY(mutex_) = 0;
  std::uint64_t ended_ ISOMESH_GUARDED_BY(mutex_) = 0;
  Clock::time_point began_at_ ISOMESH_GUARDED_BY(mutex_);
  Clock::time_point ended_at_ ISOMESH_GUARDED_BY(mutex_);
  std::string reason_ ISOMESH_GUARDED_BY(mutex_);
  std::jthread thread_;  // declared last, so that it ends before what it uses
};

}  // namespace isomesh::http
