// Events of this process: their numbers, those that are not kept, and who waits for them. Private
// to this folder.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <vector>

#include "server/store/job_store.h"

namespace isomesh::store {

// Numbers follow the clock, so that they also grow over restarts. Thread safe.
class EventLog {
 public:
  using Clock = std::chrono::steady_clock;

  // `last` is the greatest number that was given ever.
  explicit EventLog(std::uint64_t last) : last_(last) {}

  // A number for an event of the open transaction. Until settle(), nobody sees it or a later one:
  // a reader that continues after the later one would miss it. One transaction at a time.
  std::uint64_t reserve();

  // The transaction has ended, committed or not; wakes everybody.
  void settle();

  // An event that is not kept.
  void tell(Event event);

  // Events that may be seen now have smaller numbers.
  std::uint64_t end() const;

  // Those that are not kept, after `since` and before `end`.
  std::vector<Event> told(const Viewer& viewer, const std::string& job, std::uint64_t since,
                          std::uint64_t end) const;

  // Grows whenever anything is settled or told.
  std::uint64_t generation() const;

  // Waits until the generation is another one, `deadline` or close().
  void wait_beyond(std::uint64_t generation, Clock::time_point deadline) const;

  void close();
  bool is_closed() const;

 private:
  std::uint64_t next_number();

  mutable std::mutex mutex_;  // guards everything below
  mutable std::condition_variable changed_;
  std::uint64_t last_;
  std::uint64_t reserved_ = 0;  // the first of the open transaction; 0: none
  std::uint64_t generation_ = 0;
  std::deque<Event> told_;
  bool closed_ = false;
};

// Whether that viewer, asking for that job (empty: any), sees the event.
bool concerns(const Event& event, const Viewer& viewer, const std::string& job);

}  // namespace isomesh::store
