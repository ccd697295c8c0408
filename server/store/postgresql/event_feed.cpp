#include "server/store/postgresql/event_feed.h"

#include <algorithm>

#include "server/store/job_rules.h"

namespace isomesh::store::postgresql {
namespace {

constexpr std::size_t kMostRecent = 4000;
constexpr std::size_t kMostEvents = 500;
// The lower bits of an event's number are its place in the transaction. Events that are not stored
// use the upper half of these places, after all stored ones.
constexpr int kPlaceBits = 20;
constexpr std::uint64_t kFirstTold = std::uint64_t{1} << (kPlaceBits - 1);

std::uint64_t number_of(std::int64_t transaction, std::int64_t place) {
  return (static_cast<std::uint64_t>(transaction) << kPlaceBits) +
         static_cast<std::uint64_t>(place);
}
std::int64_t transaction_of(std::uint64_t number) {
  return static_cast<std::int64_t>(number >> kPlaceBits);
}
std::int64_t place_of(std::uint64_t number) {
  return static_cast<std::int64_t>(number & ((std::uint64_t{1} << kPlaceBits) - 1));
}

constexpr const char* kHorizon = "pg_snapshot_xmin(pg_current_snapshot())::text::bigint";
constexpr const char* kColumns = "tx, place, owner, job, kind, state, stage, progress, node::text";

Event event_of(const Rows& row, const std::string& node) {
  return {.id = number_of(row.integer(0), row.integer(1)),
          .owner = row.text(2),
          .job = row.text(3),
          .kind = row.choice(4, EventKind::kDone),
          .state = row.choice(5, JobState::kCancelled),
          .stage = row.choice(6, Stage::kDone),
          .progress = row.real(7),
          .is_elsewhere = row.text(8) != node};
}

}  // namespace

EventFeed::EventFeed(Database& database) : database_(database) {
  // If the database was copied to another server, events may have numbers that this server has not
  // reached yet. They are removed.
  database_.query(
      "DELETE FROM events WHERE tx >= pg_snapshot_xmax(pg_current_snapshot())::text::bigint");
  Rows row = database_.query(std::string("SELECT ") + kHorizon);
  row.next();
  const Lock lock(mutex_);
  end_ = row.integer(0);
  last_ = complete_after_ = number_of(end_, 0) - 1;
}

void EventFeed::fetch() {
  const Lock fetching(fetching_);
  std::int64_t end = 0;
  {
    const Lock lock(mutex_);
    end = end_;
  }
  // The left join returns the horizon even if there are no events before it.
  Rows rows =
      database_.query(std::string("SELECT ") + kColumns + ", horizon FROM (SELECT " + kHorizon +
                          " AS horizon) AS h LEFT JOIN events ON tx >= ?1 AND tx < "
                          "horizon ORDER BY tx, place",
                      end);
  const Lock lock(mutex_);
  const bool has_told = !told_.empty();
  bool is_new = false;
  while (rows.next()) {
    constexpr int kHorizonColumn = 9;
    end_ = std::max(end_, rows.integer(kHorizonColumn));
    if (rows.is_null(0)) continue;
    // Progress of a run precedes its end.
    number_told(rows.integer(0));
    const Event event = event_of(rows, database_.node());
    if (event.is_elsewhere && event.state == JobState::kRunning) has_runs_elsewhere_ = true;
    remember({event, true});
    is_new = true;
  }
  number_told(end_);
  if (!is_new && !has_told) return;
  ++generation_;
  changed_.notify_all();
}

// The transaction that writes a run's end also deletes the run's row. So a run with a row has not
// ended for readers of all events so far.
void EventFeed::look_at_runs() {
  const Lock fetching(fetching_);
  Rows rows = database_.query(
      "SELECT r.job, r.fence, r.owner, r.stage, r.progress, (SELECT coalesce(max(e.tx), 0) FROM "
      "events e WHERE e.job = r.job) FROM runs r WHERE r.node <> ?1::uuid",
      database_.node());
  std::map<std::string, Seen> now;
  while (rows.next()) {
    const std::string job = rows.text(0);
    Seen run = {.fence = rows.integer(1)};  // with the fence of its claim
    if (const auto before = seen_.find(job);
        before != seen_.end() && before->second.fence == run.fence) {
      run = before->second;
    }
    if (!rows.is_null(3)) {
      const auto stage = rows.choice(3, Stage::kDone);
      const double share = rows.real(4);
      const bool is_other_stage = stage != run.stage;
      if (is_other_stage || share != run.share) {
        tell({.id = 0,
              .owner = rows.text(2),
              .job = job,
              .kind = is_other_stage ? EventKind::kStage : EventKind::kProgress,
              .state = JobState::kRunning,
              .stage = stage,
              .progress = share,
              .is_elsewhere = true},
             rows.integer(5));
      }
      run.stage = stage;
      run.share = share;
    }
    now.emplace(job, run);
  }
  has_runs_elsewhere_ = !now.empty();
  seen_ = std::move(now);
}

void EventFeed::tell(Event event, std::int64_t after) {
  const Lock lock(mutex_);
  told_.push_back({std::move(event), after});
  number_told(end_);
  ++generation_;
  changed_.notify_all();
}

void EventFeed::number_told(std::int64_t before) {
  std::vector<Told> later;
  for (Told& told : told_) {
    if (told.after >= before) {
      later.push_back(std::move(told));
      continue;
    }
    told.event.id = std::max(last_ + 1, number_of(told.after, 0) + kFirstTold);
    // Progress is dropped if thousands of events came while no transaction ended.
    if (told.event.id < number_of(before, 0)) remember({std::move(told.event), false});
  }
  told_ = std::move(later);
}

void EventFeed::remember(Entry entry) {
  last_ = entry.id();
  recent_.push_back(std::move(entry));
  if (recent_.size() <= kMostRecent) return;
  complete_after_ = recent_.front().id();
  recent_.pop_front();
}

EventFeed::Recent EventFeed::recent(const Viewer& viewer, const std::string& job,
                                    std::uint64_t since) const {
  const Lock lock(mutex_);
  Recent result;
  result.generation = generation_;
  result.end = end_;
  // The database removes a job's events with the job, but this list does not.
  result.is_complete = job.empty() && since >= complete_after_;
  const auto begin = std::ranges::upper_bound(recent_, since, {}, &Entry::id);
  for (auto entry = begin; entry != recent_.end(); ++entry) {
    const bool is_wanted = result.is_complete || !entry->is_kept;
    if (is_wanted && concerns(entry->event, viewer, job)) result.events.push_back(entry->event);
  }
  return result;
}

std::vector<Event> EventFeed::kept(const Viewer& viewer, const std::string& job,
                                   std::uint64_t since, std::int64_t end) {
  Rows rows =
      database_.query(std::string("SELECT ") + kColumns +
                          " FROM events WHERE (tx, place) > (?1, ?2) AND tx < "
                          "?3 AND " +
                          (job.empty() ? "?4 = ''" : "job = ?4") + " AND " +
                          (viewer ? "owner = ?5" : "?5 IS NULL") + " ORDER BY tx, place LIMIT ?6",
                      transaction_of(since), place_of(since), end, job, viewer, kMostEvents);
  std::vector<Event> events;
  while (rows.next()) events.push_back(event_of(rows, database_.node()));
  return events;
}

std::vector<Event> EventFeed::events(const Viewer& viewer, const std::string& job,
                                     std::uint64_t since, std::chrono::milliseconds timeout) {
  const auto deadline = Clock::now() + timeout;
  fetch();
  while (true) {
    Recent seen = recent(viewer, job, since);
    std::vector<Event>& events = seen.events;
    if (!seen.is_complete) {
      const std::vector<Event> old = kept(viewer, job, since, seen.end);
      events.insert(events.end(), old.begin(), old.end());
      std::ranges::sort(events, {}, &Event::id);
    }
    if (events.size() > kMostEvents) events.resize(kMostEvents);
    Lock lock(mutex_);
    if (!events.empty() || closed_ || Clock::now() >= deadline) return events;
    changed_.wait_until(lock, deadline, [&]() ISOMESH_REQUIRES(mutex_) {
      return generation_ != seen.generation || closed_;
    });
  }
}

std::uint64_t EventFeed::last() const {
  const Lock lock(mutex_);
  return last_;
}

void EventFeed::close() {
  const Lock lock(mutex_);
  closed_ = true;
  changed_.notify_all();
}

}  // namespace isomesh::store::postgresql
