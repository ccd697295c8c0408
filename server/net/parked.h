// Requests that wait for the end of a job without a thread.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <thread>

#include "base/mutex.h"
#include "base/wakeup.h"

namespace isomesh::net {

struct ParkedRequest {
  std::string job;
  std::chrono::steady_clock::time_point until;  // latest time to resume
  std::function<void()> resume = {};            // called once; must not block
  // Its connection, open until it is resumed; -1: not watched.
  int descriptor = -1;
  // Called at most once, before `resume`, when the client has closed the connection or its sending
  // direction. Must not block. If it is empty, `resume` is called then.
  std::function<void()> abandoned = {};
};

// Thread safe.
class Parked {
 public:
  // True if a job has ended or does not exist.
  using HasEnded = std::function<bool(const std::string& job)>;

  explicit Parked(HasEnded has_ended);
  // Calls close().
  ~Parked();
  Parked(const Parked&) = delete;
  Parked& operator=(const Parked&) = delete;

  // After close() the request is resumed immediately. The limit on connections bounds the number of
  // requests.
  void park(ParkedRequest request) ISOMESH_EXCLUDES(mutex_);

  void job_ended(const std::string& job) ISOMESH_EXCLUDES(mutex_);

  void close() ISOMESH_EXCLUDES(mutex_);

 private:
  using Clock = std::chrono::steady_clock;

  void work() ISOMESH_EXCLUDES(mutex_);
  int milliseconds_to_next() ISOMESH_EXCLUDES(mutex_);
  void notice_end(std::uint64_t id) ISOMESH_EXCLUDES(mutex_);
  void unwatch(ParkedRequest& request) ISOMESH_REQUIRES(mutex_);
  template <class Predicate>
  void resume_if(const Predicate& is_over) ISOMESH_EXCLUDES(mutex_);

  const HasEnded has_ended_;
  const Descriptor epoll_;
  Wakeup wakeup_;
  std::atomic<bool> stopping_ = false;
  Mutex mutex_;
  std::map<std::uint64_t, ParkedRequest> requests_ ISOMESH_GUARDED_BY(mutex_);  // by epoll's id
  std::uint64_t last_id_ ISOMESH_GUARDED_BY(mutex_) = 0;
  bool closed_ ISOMESH_GUARDED_BY(mutex_) = false;
  std::jthread thread_;  // last, so that it ends before the members it uses
};

}  // namespace isomesh::net
