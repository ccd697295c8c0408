#include "server/store/sql/recent_events.h"

#include <algorithm>

namespace isomesh::store {

std::vector<Event> RecentEvents::events(const Viewer& viewer, const std::string& job,
                                        std::uint64_t since,
                                        std::chrono::milliseconds timeout) const {
  using Clock = std::chrono::steady_clock;
  constexpr std::size_t kMostEvents = 500;
  const Clock::time_point deadline = Clock::now() + timeout;
  Lock lock(mutex_);
  while (true) {
    const std::uint64_t generation = generation_;
    const std::uint64_t end = this->end();
    // Never for a single job: when it expires, the database removes all its events but the last,
    // and this list none.
    const bool is_complete = job.empty() && since >= complete_after_;
    std::vector<Event> events;
    const auto begin = std::ranges::upper_bound(recent_, since, {}, &Entry::id);
    for (auto entry = begin; entry != recent_.end() && entry->id() < end; ++entry) {
      const bool is_wanted = is_complete || !entry->is_kept;
      const bool is_visible = !viewer || *viewer == entry->event.owner;
      const bool is_of_job = job.empty() || job == entry->event.job;
      if (is_wanted && is_visible && is_of_job) events.push_back(entry->event);
    }
    if (!is_complete) {
      lock.unlock();
      const std::vector<Event> old = kept(viewer, job, since, end, kMostEvents);
      events.insert(events.end(), old.begin(), old.end());
      std::ranges::sort(events, {}, &Event::id);
      lock.lock();
    }
    if (events.size() > kMostEvents) events.resize(kMostEvents);
    if (!events.empty() || closed_ || Clock::now() >= deadline) return events;
    changed_.wait_until(lock, deadline, [&]() ISOMESH_REQUIRES(mutex_) {
      return generation_ != generation || closed_;
    });
  }
}

void RecentEvents::close() {
  const Lock lock(mutex_);
  closed_ = true;
  changed_.notify_all();
}

// An event that is not kept may have been added before others with smaller numbers, whose
// transaction was open.
void RecentEvents::remember(Event event, bool is_kept) {
  constexpr std::size_t kMostRecent = 4000;
  const auto place = std::ranges::upper_bound(recent_, event.id, {}, &Entry::id);
  recent_.insert(place, {std::move(event), is_kept});
  if (recent_.size() <= kMostRecent) return;
  complete_after_ = std::max(complete_after_, recent_.front().id());
  recent_.pop_front();
}

void RecentEvents::wake_readers() {
  ++generation_;
  changed_.notify_all();
}

}  // namespace isomesh::store
