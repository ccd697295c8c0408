// Events of this process: their numbers, the latest of them, and who waits for them. Private to
// this folder.
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
  explicit EventLog(std::uint64_t last) : last_(last), complete_after_(last) {}

  // Numbers an event of the open transaction, which keeps it. Until settle(), nobody sees it or a
  // later one: a reader that continues after the later one would miss it. One transaction at a
  // time.
  std::uint64_t reserve(Event event);

  // The transaction has ended; wakes everybody. Events of one that was not committed never were.
  void settle(bool is_committed);

  // An event that is not kept.
  void tell(Event event);

  // Events that may be seen now have smaller numbers.
  std::uint64_t end() const;

  struct Recent {
    std::vector<Event> events;  // oldest first
    // Nothing is missing. Otherwise there are only those that are not kept anywhere else; so it is
    // for a single job, because its events go with it when it expires.
    bool is_complete = false;
  };

  // Those after `since` and before `end` that this process remembers.
  Recent recent(const Viewer& viewer, const std::string& job, std::uint64_t since,
                std::uint64_t end) const;

  // Grows whenever anything is settled or told.
  std::uint64_t generation() const;

  // Waits until the generation is another one, `deadline` or close().
  void wait_beyond(std::uint64_t generation, Clock::time_point deadline) const;

  void close();
  bool is_closed() const;

 private:
  struct Entry {
    Event event;
    bool is_kept = false;

    std::uint64_t id() const { return event.id; }
  };

  std::uint64_t next_number();
  void remember(Entry entry);

  mutable std::mutex mutex_;  // guards everything below
  mutable std::condition_variable changed_;
  std::uint64_t last_;
  std::vector<Event> reserved_;  // of the open transaction
  std::uint64_t generation_ = 0;
  std::deque<Entry> recent_;      // by number
  std::uint64_t complete_after_;  // what is in recent_ are all events with greater numbers
  bool closed_ = false;
};

// Whether that viewer, asking for that job (empty: any), sees the event.
bool concerns(const Event& event, const Viewer& viewer, const std::string& job);

}  // namespace isomesh::store
