#include "server/store/postgresql/event_feed.h"

#include <algorithm>
#include <utility>

namespace isomesh::store::postgresql {
namespace {

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
          .stage = row.stage(6),
          .progress = row.real(7),
          .is_elsewhere = row.text(8) != node};
}

// The first transaction that may not have ended. If the database was copied to another server,
// events may have numbers that this server has not reached yet. They are removed.
std::int64_t horizon_of(Database& database) {
  database.query(
      "DELETE FROM events WHERE tx >= pg_snapshot_xmax(pg_current_snapshot())::text::bigint");
  Rows row = database.query(std::string("SELECT ") + kHorizon);
  row.next();
  return row.integer(0);
}

}  // namespace

EventFeed::EventFeed(Database& database) : EventFeed(database, horizon_of(database)) {}

EventFeed::EventFeed(Database& database, std::int64_t end)
    : RecentEvents(number_of(end, 0) - 1), database_(database), end_(end) {}

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
    Event event = event_of(rows, database_.node());
    if (event.is_elsewhere && event.state == JobState::kRunning) has_runs_elsewhere_ = true;
    append(std::move(event), true);
    is_new = true;
  }
  number_told(end_);
  if (is_new || has_told) wake_readers();
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
      const auto stage = rows.stage(3);
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
  wake_readers();
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
    if (told.event.id < number_of(before, 0)) append(std::move(told.event), false);
  }
  told_ = std::move(later);
}

void EventFeed::append(Event event, bool is_kept) {
  last_ = event.id;
  remember(std::move(event), is_kept);
}

std::uint64_t EventFeed::end() const { return number_of(end_, 0); }

std::vector<Event> EventFeed::kept(const Viewer& viewer, const std::string& job,
                                   std::uint64_t since, std::uint64_t end,
                                   std::size_t limit) const {
  Rows rows = database_.query(
      std::string("SELECT ") + kColumns +
          " FROM events WHERE (tx, place) > (?1, ?2) AND tx < "
          "?3 AND " +
          (job.empty() ? "?4 = ''" : "job = ?4") + " AND " +
          (viewer ? "owner = ?5" : "?5 IS NULL") + " ORDER BY tx, place LIMIT ?6",
      transaction_of(since), place_of(since), transaction_of(end), job, viewer, limit);
  std::vector<Event> events;
  while (rows.next()) events.push_back(event_of(rows, database_.node()));
  return events;
}

std::uint64_t EventFeed::last() const {
  const Lock lock(mutex_);
  return last_;
}

}  // namespace isomesh::store::postgresql
