// The latest events of jobs, and the readers that wait for more. For stores only.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <string>
#include <utility>
#include <vector>

#include "base/mutex.h"
#include "server/store/job_store.h"

namespace isomesh::store {

// Each engine numbers its events and adds them. Thread safe.
class RecentEvents {
 public:
  // `last` is the greatest number ever used.
  explicit RecentEvents(std::uint64_t last) : last_(last), complete_after_(last) {}
  virtual ~RecentEvents() = default;
  RecentEvents(const RecentEvents&) = delete;
  RecentEvents& operator=(const RecentEvents&) = delete;

  // As JobStore::events. Events that are not here are read from the database.
  std::vector<Event> events(const Viewer& viewer, const std::string& job, std::uint64_t since,
                            std::chrono::milliseconds timeout) const;

  // Ends all waiting, also of later calls.
  void close();

 protected:
  // Adds an event by its number. A kept one is also in the database.
  void remember(Event event, bool is_kept) ISOMESH_REQUIRES(mutex_);
  void wake_readers() ISOMESH_REQUIRES(mutex_);

  // Visible events have smaller numbers than this.
  virtual std::uint64_t end() const ISOMESH_REQUIRES(mutex_) = 0;
  // At most `limit` events in the database after `since` and before `end`, oldest first.
  virtual std::vector<Event> kept(const Viewer& viewer, const std::string& job, std::uint64_t since,
                                  std::uint64_t end, std::size_t limit) const = 0;

  mutable Mutex mutex_;
  std::uint64_t last_ ISOMESH_GUARDED_BY(mutex_);  // the greatest number used

 private:
  struct Entry {
    Event event;
    bool is_kept = false;

    std::uint64_t id() const { return event.id; }
  };

  mutable Condition changed_;
  std::uint64_t generation_ ISOMESH_GUARDED_BY(mutex_) = 0;  // increments with each wake_readers()
  std::deque<Entry> recent_ ISOMESH_GUARDED_BY(mutex_);      // by number
  // recent_ holds all events with greater numbers than this.
  std::uint64_t complete_after_ ISOMESH_GUARDED_BY(mutex_);
  bool closed_ ISOMESH_GUARDED_BY(mutex_) = false;
};

}  // namespace isomesh::store
