#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <vector>

#include "base/mutex.h"
#include "server/store/job_store.h"
#include "server/store/postgresql/database.h"

namespace isomesh::store::postgresql {

// The events of all nodes as this one has read them, and those that only this one knows.
//
// An event's number is the transaction that wrote it and its place there. Transactions do not end
// in the order of their numbers, so what is read ends before the first that is still under way:
// whoever goes on after a number that was seen misses nothing. Thread safe.
class EventFeed {
 public:
  using Clock = std::chrono::steady_clock;

  // Begins after all that is there. `database` must outlive it.
  explicit EventFeed(Database& database);

  // Reads what has come. Throws Error kUnavailable or kInternal.
  void fetch();

  // Tells how far the runs of other nodes are by their last renewals, where that is news. What they
  // tell meanwhile is not seen. Throws as fetch().
  void look_at_runs();

  // False until a run of another node was seen, and after a look that found none.
  bool has_runs_elsewhere() const { return has_runs_elsewhere_; }

  // An event that is not kept; it is seen after those of the transaction `after`.
  void tell(Event event, std::int64_t after);

  // As JobStore::events.
  std::vector<Event> events(const Viewer& viewer, const std::string& job, std::uint64_t since,
                            std::chrono::milliseconds timeout);

  std::uint64_t last() const;

  void close();

 private:
  struct Entry {
    Event event;
    bool is_kept = false;

    std::uint64_t id() const { return event.id; }
  };
  struct Told {
    Event event;
    std::int64_t after = 0;
  };
  struct Recent {
    std::vector<Event> events;
    bool is_complete = false;  // false: those that are kept have to be read
    std::uint64_t generation = 0;
    std::int64_t end = 0;  // the first transaction that is not read
  };

  Recent recent(const Viewer& viewer, const std::string& job, std::uint64_t since) const;
  std::vector<Event> kept(const Viewer& viewer, const std::string& job, std::uint64_t since,
                          std::int64_t end);
  void remember(Entry entry) ISOMESH_REQUIRES(mutex_);
  // Those that come before what that transaction has written.
  void number_told(std::int64_t before) ISOMESH_REQUIRES(mutex_);

  // A run of another node, as it was told last.
  struct Seen {
    std::int64_t fence = 0;
    Stage stage = Stage::kLoad;
    double share = 0;
  };

  Database& database_;
  Mutex fetching_;
  std::map<std::string, Seen> seen_ ISOMESH_GUARDED_BY(fetching_);  // by job
  std::atomic<bool> has_runs_elsewhere_ = false;
  mutable Mutex mutex_;
  mutable Condition changed_;
  std::int64_t end_ ISOMESH_GUARDED_BY(mutex_) = 0;  // the first transaction that is not read
  std::uint64_t last_ ISOMESH_GUARDED_BY(mutex_) = 0;
  std::uint64_t generation_ ISOMESH_GUARDED_BY(mutex_) = 0;
  std::deque<Entry> recent_ ISOMESH_GUARDED_BY(mutex_);  // by number
  // recent_ holds all events with greater numbers than this.
  std::uint64_t complete_after_ ISOMESH_GUARDED_BY(mutex_) = 0;
  std::vector<Told> told_ ISOMESH_GUARDED_BY(mutex_);  // whose transaction is not read yet
  bool closed_ ISOMESH_GUARDED_BY(mutex_) = false;
};

}  // namespace isomesh::store::postgresql
