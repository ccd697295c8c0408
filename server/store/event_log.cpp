#include "server/store/event_log.h"

#include <algorithm>

#include "server/store/database.h"

namespace isomesh::store {
namespace {

constexpr std::size_t kMostTold = 2000;

}  // namespace

std::uint64_t EventLog::reserve() {
  const std::lock_guard lock(mutex_);
  const std::uint64_t number = next_number();
  if (reserved_ == 0) reserved_ = number;
  return number;
}

void EventLog::settle() {
  const std::lock_guard lock(mutex_);
  reserved_ = 0;
  ++generation_;
  changed_.notify_all();
}

void EventLog::tell(Event event) {
  const std::lock_guard lock(mutex_);
  event.id = next_number();
  told_.push_back(std::move(event));
  if (told_.size() > kMostTold) told_.pop_front();
  ++generation_;
  changed_.notify_all();
}

std::uint64_t EventLog::end() const {
  const std::lock_guard lock(mutex_);
  return reserved_ == 0 ? last_ + 1 : reserved_;
}

std::vector<Event> EventLog::told(const Viewer& viewer, const std::string& job, std::uint64_t since,
                                  std::uint64_t end) const {
  const std::lock_guard lock(mutex_);
  std::vector<Event> result;
  const auto begin = std::ranges::upper_bound(told_, since, {}, &Event::id);
  for (auto event = begin; event != told_.end() && event->id < end; ++event) {
    if (concerns(*event, viewer, job)) result.push_back(*event);
  }
  return result;
}

std::uint64_t EventLog::generation() const {
  const std::lock_guard lock(mutex_);
  return generation_;
}

void EventLog::wait_beyond(std::uint64_t generation, Clock::time_point deadline) const {
  std::unique_lock lock(mutex_);
  changed_.wait_until(lock, deadline, [&] { return generation_ != generation || closed_; });
}

void EventLog::close() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
  changed_.notify_all();
}

bool EventLog::is_closed() const {
  const std::lock_guard lock(mutex_);
  return closed_;
}

std::uint64_t EventLog::next_number() {
  last_ = std::max(last_ + 1, static_cast<std::uint64_t>(now_us()));
  return last_;
}

bool concerns(const Event& event, const Viewer& viewer, const std::string& job) {
  return (!viewer || *viewer == event.owner) && (job.empty() || job == event.job);
}

}  // namespace isomesh::store
