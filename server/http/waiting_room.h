// Requests that wait for a job's end, none of which holds a thread.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "server/http/exchange.h"

namespace isomesh::http {

// Thread safe.
class WaitingRoom {
 public:
  // Whether a job has ended, or does not exist.
  using HasEnded = std::function<bool(const std::string& job)>;
  // Takes a request whose waiting is over.
  using CallIn = std::function<void(const std::shared_ptr<Exchange>& exchange)>;

  static constexpr std::size_t kMostWaiting = 1024;

  WaitingRoom(HasEnded has_ended, CallIn call_in);
  // As close().
  ~WaitingRoom();
  WaitingRoom(const WaitingRoom&) = delete;
  WaitingRoom& operator=(const WaitingRoom&) = delete;

  // Takes a request that is parked. One that finds the room full is called in at once.
  void seat(const std::shared_ptr<Exchange>& exchange);

  // Calls in who waits for that job.
  void ended(const std::string& job);

  // Calls all in, and whoever comes from now on at once.
  void close();

 private:
  using Clock = std::chrono::steady_clock;

  void look_at_the_clock(const std::stop_token& stop);
  template <class Predicate>
  void call_in_if(const Predicate& is_over);

  const HasEnded has_ended_;
  const CallIn call_in_;
  std::mutex mutex_;  // guards what follows
  std::condition_variable_any changed_;
  std::vector<std::shared_ptr<Exchange>> waiting_;
  bool closed_ = false;
  std::jthread clock_;  // last: joined first
};

}  // namespace isomesh::http
