// Limits how often something is told, and tells the number of what it left out.
#pragma once

#include <chrono>
#include <cstdint>
#include <exception>
#include <functional>
#include <optional>
#include <stop_token>
#include <thread>
#include <utility>

#include "base/mutex.h"

namespace isomesh {

// Tells at most one event in each pause: the first one at once, and the last one of those that came
// during a pause when it is over, with the number of the others. So no event is lost, also if none
// follows. Thread safe.
template <class Event>
class Throttle {
 public:
  // False, or an exception: it could not be told, and is tried again after the pause. `others` is
  // the number of events since the last one that was told.
  using Tell = std::function<bool(const Event& event, std::uint64_t others)>;

  Throttle(std::chrono::milliseconds pause, Tell tell)
      : pause_(pause),
        tell_(std::move(tell)),
        thread_([this](const std::stop_token& stop) { run(stop); }) {}

  // Tells what is left.
  ~Throttle() { end(); }
  Throttle(const Throttle&) = delete;
  Throttle& operator=(const Throttle&) = delete;

  // Tells what is left, and returns the number of events that could not be told. Add none later.
  std::uint64_t end() ISOMESH_EXCLUDES(mutex_) {
    thread_.request_stop();
    if (thread_.joinable()) thread_.join();
    std::optional<Left> left;
    {
      const Lock lock(mutex_);
      next_ = Clock::time_point::min();
      left = take();
    }
    if (left) tell(*std::move(left));
    const Lock lock(mutex_);
    return count_;
  }

  // Returns when the event is told, or left for later.
  void add(Event event) ISOMESH_EXCLUDES(mutex_) {
    std::optional<Left> left;
    {
      const Lock lock(mutex_);
      left_ = std::move(event);
      ++count_;
      left = take();
      if (!left) changed_.notify_all();
    }
    if (left) tell(*std::move(left));
  }

 private:
  using Clock = std::chrono::steady_clock;

  struct Left {
    Event event;
    std::uint64_t count = 0;  // with this one
  };

  // The event to tell now; empty during a pause, and while something is told.
  std::optional<Left> take() ISOMESH_REQUIRES(mutex_) {
    if (!left_ || Clock::now() < next_) return std::nullopt;
    next_ = Clock::time_point::max();
    return Left{*std::exchange(left_, std::nullopt), std::exchange(count_, 0)};
  }

  void tell(Left left) ISOMESH_EXCLUDES(mutex_) {
    bool is_told = false;
    try {
      is_told = tell_(left.event, left.count - 1);
    } catch (const std::exception&) {
      // Not logged: logging needs memory, too, and the event is told later.
    }
    const Lock lock(mutex_);
    next_ = Clock::now() + pause_;
    changed_.notify_all();
    if (is_told) return;
    count_ += left.count;
    if (!left_) left_ = std::move(left.event);
  }

  void run(const std::stop_token& stop) ISOMESH_EXCLUDES(mutex_) {
    while (!stop.stop_requested()) {
      std::optional<Left> left;
      {
        Lock lock(mutex_);
        const auto is_left = [this]() ISOMESH_REQUIRES(mutex_) { return left_.has_value(); };
        if (!changed_.wait(lock, stop, is_left)) return;
        const Clock::time_point until = next_;
        changed_.wait_until(lock, stop, until,
                            [&]() ISOMESH_REQUIRES(mutex_) { return next_ != until; });
        if (stop.stop_requested()) return;
        left = take();
      }
      if (left) tell(*std::move(left));
    }
  }

  const std::chrono::milliseconds pause_;
  const Tell tell_;
  Mutex mutex_;
  Condition changed_;
  Clock::time_point next_ ISOMESH_GUARDED_BY(mutex_);
  std::optional<Event> left_ ISOMESH_GUARDED_BY(mutex_);  // the last that was not told
  std::uint64_t count_ ISOMESH_GUARDED_BY(mutex_) = 0;    // of those that were not told
  std::jthread thread_;                                   // last: uses the other members
};

}  // namespace isomesh
