#include "server/store/sqlite/event_log.h"

#include <algorithm>
#include <utility>

namespace isomesh::store {
namespace {

std::uint64_t greatest_event(Database& database) {
  const Reading reading(database.reader());
  Rows query = reading->query("SELECT coalesce(max(id), 0) FROM events");
  query.next();
  return static_cast<std::uint64_t>(query.integer(0));
}

}  // namespace

EventLog::EventLog(Database& database)
    : RecentEvents(greatest_event(database)), database_(database) {}

std::uint64_t EventLog::reserve(Event event) {
  const Lock lock(mutex_);
  event.id = next_number();
  reserved_.push_back(std::move(event));
  return reserved_.back().id;
}

void EventLog::withdraw(std::size_t count) {
  const Lock lock(mutex_);
  reserved_.resize(reserved_.size() - count);
  wake_readers();
}

void EventLog::end_transaction(bool is_committed) {
  const Lock lock(mutex_);
  if (is_committed) {
    for (Event& event : reserved_) remember(std::move(event), true);
  }
  reserved_.clear();
  wake_readers();
}

void EventLog::tell(Event event) {
  const Lock lock(mutex_);
  event.id = next_number();
  remember(std::move(event), false);
  wake_readers();
}

std::uint64_t EventLog::last() const {
  const Lock lock(mutex_);
  return end() - 1;
}

std::uint64_t EventLog::end() const { return reserved_.empty() ? last_ + 1 : reserved_.front().id; }

std::uint64_t EventLog::next_number() {
  last_ = std::max(last_ + 1, static_cast<std::uint64_t>(now_us()));
  return last_;
}

std::vector<Event> EventLog::kept(const Viewer& viewer, const std::string& job, std::uint64_t since,
                                  std::uint64_t end, std::size_t limit) const {
  const Reading reading(database_.reader());
  const std::string sql =
      std::string("SELECT id, owner, job, kind, state, stage, progress FROM events WHERE ") +
      (job.empty() ? "?1 = ''" : "job = ?1") + " AND id > ?2 AND id < ?3" +
      (viewer ? " AND owner = ?4" : " AND ?4 IS NULL") + " ORDER BY id LIMIT ?5";
  Rows row = reading->query(sql, job, since, end, viewer, limit);
  std::vector<Event> events;
  while (row.next()) {
    events.push_back({.id = static_cast<std::uint64_t>(row.integer(0)),
                      .owner = row.text(1),
                      .job = row.text(2),
                      .kind = row.choice(3, EventKind::kDone),
                      .state = row.choice(4, JobState::kCancelled),
                      .stage = row.stage(5),
                      .progress = row.real(6)});
  }
  return events;
}

}  // namespace isomesh::store
