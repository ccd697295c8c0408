// Events of this process: their numbers, the latest of them, and who waits for them. Private to
// this folder.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <vector>

#include "base/mutex.h"
#include "server/store/job_store.h"

namespace isomesh::store {

// Numbers follow the clock, so that they also grow over restarts. Thread safe.
class EventLog {
 public:
  using Clock = std::chrono::steady_clock;

  // `last` is the greatest number that was given ever.
  explicit EventLog(std::uint64_t last) : last_(last), complete_after_(last) {}

  // Numbers an event that the open transaction writes. Until settle() nobody sees it, nor any event
  // with a greater number: a reader that went on after the greater one would miss this one. One
  // transaction at a time.
  std::uint64_t reserve(Event event);

  // The last `count` of them never were: their part of the transaction was rolled back.
  void withdraw(std::size_t count);

  // The transaction has ended; wakes everybody. Events of one that was not committed never were.
  void settle(bool is_committed);

  // An event that is not kept.
  void tell(Event event);

  // Events that may be seen now have smaller numbers.
  std::uint64_t end() const;

  struct Recent {
    std::vector<Event> events;  // oldest first
    // True: these are all events that were asked for. False: the events that the database keeps
    // are left out and have to be read there. That is so when `since` is older than what is
    // remembered, and whenever one job is asked for: its events are removed from the database when
    // it expires, but not from here.
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
