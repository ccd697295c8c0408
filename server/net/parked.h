// Requests that wait for the end of a job without holding a thread.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "base/mutex.h"

namespace isomesh::net {

struct ParkedRequest {
  std::string job;                              // whose end it waits for
  std::chrono::steady_clock::time_point until;  // when it goes on whether the job has ended or not
  std::function<void()> resume;                 // called once; must not block
};

// Thread safe.
class Parked {
 public:
  // Whether a job has ended, or does not exist.
  using HasEnded = std::function<bool(const std::string& job)>;

  static constexpr std::size_t kMostRequests = 1024;

  explicit Parked(HasEnded has_ended);
  // As close().
  ~Parked();
  Parked(const Parked&) = delete;
  Parked& operator=(const Parked&) = delete;

  // When kMostRequests wait already, or after close(), the request is resumed at once.
  void park(ParkedRequest request) ISOMESH_EXCLUDES(mutex_);

  // Resumes all that wait for that job.
  void job_ended(const std::string& job) ISOMESH_EXCLUDES(mutex_);

  // Resumes all that wait.
  void close() ISOMESH_EXCLUDES(mutex_);

 private:
  using Clock = std::chrono::steady_clock;

  void resume_overdue(const std::stop_token& stop) ISOMESH_EXCLUDES(mutex_);
  template <class Predicate>
  void resume_if(const Predicate& is_over) ISOMESH_EXCLUDES(mutex_);

  const HasEnded has_ended_;
  Mutex mutex_;
  Condition changed_;
  std::vector<ParkedRequest> requests_ ISOMESH_GUARDED_BY(mutex_);
  std::uint64_t count_ ISOMESH_GUARDED_BY(mutex_) = 0;  // of all that ever came
  bool closed_ ISOMESH_GUARDED_BY(mutex_) = false;
  std::jthread clock_;  // declared last, so that it ends before what it uses
};

}  // namespace isomesh::net
