#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "base/mutex.h"
#include "server/store/postgresql/database.h"
#include "server/store/sql/recent_events.h"

namespace isomesh::store::postgresql {

// Events of all nodes, as read by this one, and unstored events known only to this node.
//
// An event's number consists of the transaction that wrote it and its place there. Transactions do
// not end in the order of their numbers. So reading stops before the first transaction that is
// still open, and a reader that continues after a number it has seen misses nothing. Thread safe.
class EventFeed : public RecentEvents {
 public:
  // Starts after all existing events. `database` must outlive this object.
  explicit EventFeed(Database& database);

  // Reads new events. Throws Error kUnavailable or kInternal.
  void fetch();

  // Reads the latest renewals of runs on other nodes, and emits an event if they show progress.
  // Progress between two calls is not seen. Throws as fetch().
  void look_at_runs();

  // False until a run of another node was seen, and after a call of look_at_runs() that found none.
  bool has_runs_elsewhere() const { return has_runs_elsewhere_; }

  // Adds an event that is not stored; it comes after those of the transaction `after`.
  void tell(Event event, std::int64_t after);

  std::uint64_t last() const;

 private:
  struct Told {
    Event event;
    std::int64_t after = 0;
  };

  // `end` is the first transaction not yet read.
  EventFeed(Database& database, std::int64_t end);

  std::uint64_t end() const override ISOMESH_REQUIRES(mutex_);
  std::vector<Event> kept(const Viewer& viewer, const std::string& job, std::uint64_t since,
                          std::uint64_t end, std::size_t limit) const override;
  // Adds an event; it has the greatest number so far.
  void append(Event event, bool is_kept) ISOMESH_REQUIRES(mutex_);
  // Numbers the unstored events whose transaction is before `before`.
  void number_told(std::int64_t before) ISOMESH_REQUIRES(mutex_);

  // A run of another node, as last reported.
  struct Seen {
    std::int64_t fence = 0;
    Stage stage = Stage::kLoad;
    double share = 0;
  };

  Database& database_;
  Mutex fetching_;
  std::map<std::string, Seen> seen_ ISOMESH_GUARDED_BY(fetching_);  // by job
  std::atomic<bool> has_runs_elsewhere_ = false;
  std::int64_t end_ ISOMESH_GUARDED_BY(mutex_);        // the first transaction not yet read
  std::vector<Told> told_ ISOMESH_GUARDED_BY(mutex_);  // whose transaction is not yet read
};

}  // namespace isomesh::store::postgresql
