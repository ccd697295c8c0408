// Events of this process, and their numbers. Private to this folder.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "server/store/sql/recent_events.h"
#include "server/store/sqlite/database.h"

namespace isomesh::store {

// Numbers are derived from the clock, so that they increase over restarts. Thread safe.
class EventLog : public RecentEvents {
 public:
  // `database` must outlive this object.
  explicit EventLog(Database& database);

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

  // The greatest number of a visible event.
  std::uint64_t last() const;

 private:
  std::uint64_t next_number() ISOMESH_REQUIRES(mutex_);
  std::uint64_t end() const override ISOMESH_REQUIRES(mutex_);
  std::vector<Event> kept(const Viewer& viewer, const std::string& job, std::uint64_t since,
                          std::uint64_t end, std::size_t limit) const override;

  Database& database_;
  std::vector<Event> reserved_ ISOMESH_GUARDED_BY(mutex_);  // of the open transaction
};

}  // namespace isomesh::store
