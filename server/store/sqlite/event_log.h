// Events of this process: their numbers, the latest events, and the readers that wait for them.
// Private to this folder.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <vector>

#include "base/mutex.h"
#include "server/store/job_store.h"

namespace isomesh::store {

// Numbers are derived from the clock, so that they increase over restarts. Thread safe.
class EventLog {
 public:
  using Clock = std::chrono::steady_clock;

  // `last` is the greatest number ever used.
  explicit EventLog(std::uint64_t last) : last_(last), complete_after_(last) {}

  // Numbers an event written by the open transaction. Neither this event nor any with a greater
  // number is visible until end_transaction(); otherwise a reader that continues after the greater
  // one would miss this one. One transaction at a time.
  std::uint64_t reserve(Event event);

  // Removes the last `count` events, because their part of the transaction was rolled back.
  void withdraw(std::size_t count);

  // Ends the transaction and wakes all readers. Discards its events unless it was committed.
  void end_transaction(bool is_committed);

  // Adds an event that is not stored.
  void tell(Event event);

  // Visible events have smaller numbers than this.
  std::uint64_t end() const;

  struct Recent {
    std::vector<Event> events;  // oldest first
    // True: these are all requested events. False: stored events are omitted and must be read from
    // the database. That is the case if `since` is older than the oldest event here, and for a
    // single job: when a job expires, the database removes its events but this list does not.
    bool is_complete = false;
  };

  // The events here after `since` and before `end`.
  Recent recent(const Viewer& viewer, const std::string& job, std::uint64_t since,
                std::uint64_t end) const;

  // Increments with each end_transaction() and tell().
  std::uint64_t generation() const;

  // Waits until the generation changes, the deadline, or close().
  void wait_beyond(std::uint64_t generation, Clock::time_point deadline) const;

  void close();
  bool is_closed() const;

 private:
  struct Entry {
    Event event;
    bool is_kept = false;

    std::uint64_t id() const { return event.id; }
  };

  std::uint64_t next_number() ISOMESH_REQUIRES(mutex_);
  void remember(Entry entry) ISOMESH_REQUIRES(mutex_);

  mutable Mutex mutex_;
  mutable Condition changed_;
  std::uint64_t last_ ISOMESH_GUARDED_BY(mutex_);
  std::vector<Event> reserved_ ISOMESH_GUARDED_BY(mutex_);  // of the open transaction
  std::uint64_t generation_ ISOMESH_GUARDED_BY(mutex_) = 0;
  std::deque<Entry> recent_ ISOMESH_GUARDED_BY(mutex_);  // by number
  // recent_ holds all events with greater numbers than this.
  std::uint64_t complete_after_ ISOMESH_GUARDED_BY(mutex_);
  bool closed_ ISOMESH_GUARDED_BY(mutex_) = false;
};

}  // namespace isomesh::store
