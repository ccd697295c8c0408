#include "server/store/sqlite/event_log.h"

#include <algorithm>

#include "server/store/job_rules.h"
#include "server/store/sqlite/database.h"

namespace isomesh::store {
namespace {

constexpr std::size_t kMostRecent = 4000;

}  // namespace

std::uint64_t EventLog::reserve(Event event) {
  const Lock lock(mutex_);
  event.id = next_number();
  reserved_.push_back(std::move(event));
  return reserved_.back().id;
}

void EventLog::withdraw(std::size_t count) {
  const Lock lock(mutex_);
  reserved_.resize(reserved_.size() - count);
  ++generation_;
  changed_.notify_all();
}

void EventLog::end_transaction(bool is_committed) {
  const Lock lock(mutex_);
  if (is_committed) {
    for (Event& event : reserved_) remember({std::move(event), true});
  }
  reserved_.clear();
  ++generation_;
  changed_.notify_all();
}

void EventLog::tell(Event event) {
  const Lock lock(mutex_);
  event.id = next_number();
  remember({std::move(event), false});
  ++generation_;
  changed_.notify_all();
}

std::uint64_t EventLog::end() const {
  const Lock lock(mutex_);
  return reserved_.empty() ? last_ + 1 : reserved_.front().id;
}

EventLog::Recent EventLog::recent(const Viewer& viewer, const std::string& job, std::uint64_t since,
                                  std::uint64_t end) const {
  const Lock lock(mutex_);
  Recent result;
  result.is_complete = job.empty() && since >= complete_after_;
  const auto begin = std::ranges::upper_bound(recent_, since, {}, &Entry::id);
  for (auto entry = begin; entry != recent_.end() && entry->id() < end; ++entry) {
    const bool is_wanted = result.is_complete || !entry->is_kept;
    if (is_wanted && concerns(entry->event, viewer, job)) result.events.push_back(entry->event);
  }
  return result;
}

std::uint64_t EventLog::generation() const {
  const Lock lock(mutex_);
  return generation_;
}

void EventLog::wait_beyond(std::uint64_t generation, Clock::time_point deadline) const {
  Lock lock(mutex_);
  changed_.wait_until(lock, deadline, [&]() ISOMESH_REQUIRES(mutex_) {
    return generation_ != generation || closed_;
  });
}

void EventLog::close() {
  const Lock lock(mutex_);
  closed_ = true;
  changed_.notify_all();
}

bool EventLog::is_closed() const {
  const Lock lock(mutex_);
  return closed_;
}

std::uint64_t EventLog::next_number() {
  last_ = std::max(last_ + 1, static_cast<std::uint64_t>(now_us()));
  return last_;
}

// Unstored events added while a transaction was open have greater numbers than its events.
void EventLog::remember(Entry entry) {
  const auto place = std::ranges::upper_bound(recent_, entry.id(), {}, &Entry::id);
  recent_.insert(place, std::move(entry));
  if (recent_.size() <= kMostRecent) return;
  complete_after_ = std::max(complete_after_, recent_.front().id());
  recent_.pop_front();
}

}  // namespace isomesh::store
