#include "server/http/waiting_room.h"

#include <algorithm>
#include <utility>

namespace isomesh::http {

WaitingRoom::WaitingRoom(HasEnded has_ended, CallIn call_in)
    : has_ended_(std::move(has_ended)),
      call_in_(std::move(call_in)),
      clock_([this](const std::stop_token& stop) { look_at_the_clock(stop); }) {}

WaitingRoom::~WaitingRoom() {
  close();
  clock_.request_stop();
}

void WaitingRoom::seat(const std::shared_ptr<Exchange>& exchange) {
  const std::string job = exchange->parking()->job;
  {
    const std::lock_guard lock(mutex_);
    if (!closed_ && waiting_.size() < kMostWaiting) {
      waiting_.push_back(exchange);
      changed_.notify_all();
    } else {
      exchange->resume();
      return call_in_(exchange);
    }
  }
  // The job may have ended on the way here, when nobody waited for it.
  if (has_ended_(job)) ended(job);
}

void WaitingRoom::ended(const std::string& job) {
  call_in_if([&](const Parking& parking) { return parking.job == job; });
}

void WaitingRoom::close() {
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
  }
  call_in_if([](const Parking&) { return true; });
}

template <class Predicate>
void WaitingRoom::call_in_if(const Predicate& is_over) {
  std::vector<std::shared_ptr<Exchange>> called;
  {
    const std::lock_guard lock(mutex_);
    const auto over =
        std::stable_partition(waiting_.begin(), waiting_.end(),
                              [&](const auto& exchange) { return !is_over(*exchange->parking()); });
    called.assign(std::make_move_iterator(over), std::make_move_iterator(waiting_.end()));
    waiting_.erase(over, waiting_.end());
  }
  for (const auto& exchange : called) {
    exchange->resume();
    call_in_(exchange);
  }
}

void WaitingRoom::look_at_the_clock(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    {
      std::unique_lock lock(mutex_);
      Clock::time_point next = Clock::time_point::max();
      for (const auto& exchange : waiting_) next = std::min(next, exchange->parking()->until);
      if (next == Clock::time_point::max()) {
        changed_.wait(lock, stop, [&] { return !waiting_.empty(); });
        continue;
      }
      const std::size_t count = waiting_.size();
      changed_.wait_until(lock, stop, next, [&] { return waiting_.size() != count; });
    }
    const auto now = Clock::now();
    call_in_if([&](const Parking& parking) { return now >= parking.until; });
  }
}

}  // namespace isomesh::http
