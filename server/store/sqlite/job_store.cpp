// What can be asked about jobs. job_queue.cpp has what changes them, job_retention.cpp what removes
// them.
#include "server/store/sqlite/job_store.h"

#include <algorithm>

#include "proto/json.h"
#include "server/store/job_rules.h"
#include "server/store/sqlite/job_rows.h"

namespace isomesh::store {
namespace {

constexpr std::size_t kMostEvents = 500;

Event event_of(const Query& row) {
  return {static_cast<std::uint64_t>(row.integer(0)),
          row.text(1),
          row.text(2),
          static_cast<EventKind>(row.integer(3)),
          static_cast<JobState>(row.integer(4)),
          static_cast<Stage>(row.integer(5)),
          row.real(6)};
}

std::uint64_t greatest_event(Connection& connection) {
  Query query = connection.query("SELECT coalesce(max(id), 0) FROM events");
  query.next();
  return static_cast<std::uint64_t>(query.integer(0));
}

}  // namespace

SqliteJobStore::SqliteJobStore(Database& database, const BlobStore& blobs, JobStoreOptions options)
    : database_(database),
      blobs_(blobs),
      options_(std::move(options)),
      log_(greatest_event(database.reader())) {}

Job SqliteJobStore::get(const Viewer& viewer, const std::string& id) const {
  const Reading reading(database_.reader());
  return with_progress(found(reading.connection(), viewer, id));
}

JobAccount SqliteJobStore::account(const std::string& id) const {
  const Reading reading(database_.reader());
  const Row row = found(reading.connection(), std::nullopt, id);
  return {with_progress(row), row.attempts};
}

std::vector<Job> SqliteJobStore::list(const Viewer& viewer, std::optional<JobState> state,
                                      const std::string& after, std::size_t limit) const {
  // What is in the records is looked at without the connection, so that others do not wait for it.
  struct Found {
    std::string record;
    std::uint64_t fence;
  };
  std::vector<Found> found;
  // A condition that is not there costs no index.
  const std::string sql =
      std::string("SELECT record, fence FROM jobs WHERE ") +
      (viewer ? "owner = ?1" : "?1 IS NULL") + (state ? " AND state = ?2" : " AND ?2 IS NULL") +
      (after.empty() ? " AND ?3 = ''" : " AND id < ?3") + " ORDER BY id DESC LIMIT ?4";
  {
    const Reading reading(database_.reader());
    Query query = reading->query(sql, viewer, state, after, limit);
    while (query.next()) {
      found.push_back({query.text(0), static_cast<std::uint64_t>(query.integer(1))});
    }
  }
  std::vector<Job> jobs;
  jobs.reserve(found.size());
  for (const Found& each : found) {
    Row row;
    row.job = job_from_record(each.record);
    row.fence = each.fence;
    jobs.push_back(with_progress(row));
  }
  return jobs;
}

std::vector<Event> SqliteJobStore::events(const Viewer& viewer, const std::string& job,
                                          std::uint64_t since,
                                          std::chrono::milliseconds timeout) const {
  const auto deadline = EventLog::Clock::now() + timeout;
  while (true) {
    const std::uint64_t generation = log_.generation();
    const std::uint64_t end = log_.end();
    auto [events, is_complete] = log_.recent(viewer, job, since, end);
    if (!is_complete) {
      const std::vector<Event> kept = kept_events(viewer, job, since, end);
      events.insert(events.end(), kept.begin(), kept.end());
      std::ranges::sort(events, {}, &Event::id);
    }
    if (events.size() > kMostEvents) events.resize(kMostEvents);
    if (!events.empty() || log_.is_closed() || EventLog::Clock::now() >= deadline) return events;
    log_.wait_beyond(generation, deadline);
  }
}

std::vector<Event> SqliteJobStore::kept_events(const Viewer& viewer, const std::string& job,
                                               std::uint64_t since, std::uint64_t end) const {
  const Reading reading(database_.reader());
  const std::string sql =
      std::string("SELECT id, owner, job, kind, state, stage, progress FROM events WHERE ") +
      (job.empty() ? "?1 = ''" : "job = ?1") + " AND id > ?2 AND id < ?3" +
      (viewer ? " AND owner = ?4" : " AND ?4 IS NULL") + " ORDER BY id LIMIT ?5";
  Query query = reading->query(sql, job, since, end, viewer, kMostEvents);
  std::vector<Event> events;
  while (query.next()) events.push_back(event_of(query));
  return events;
}

QueueDepth SqliteJobStore::depth(const Viewer& viewer) const {
  const Reading reading(database_.reader());
  const std::string mine = viewer ? " AND owner = ?1" : " AND ?1 IS NULL";
  QueueDepth depth;
  Query queued = reading->query(
      "SELECT priority, count(*) FROM jobs WHERE state = 0" + mine + " GROUP BY priority", viewer);
  while (queued.next()) {
    depth.queued.at(static_cast<std::size_t>(queued.integer(0))) =
        static_cast<std::size_t>(queued.integer(1));
  }
  Query running = reading->query("SELECT count(*) FROM jobs WHERE state = 1" + mine, viewer);
  running.next();
  depth.running = static_cast<std::size_t>(running.integer(0));
  Query waiting = reading->query(
      "SELECT count(*) FROM jobs WHERE state = 0 AND waiting_for IS NOT NULL AND waiting_for = ?2" +
          mine,
      viewer, WaitingFor::kDisk);
  waiting.next();
  depth.waiting_for_disk = static_cast<std::size_t>(waiting.integer(0));
  return depth;
}

bool SqliteJobStore::is_full() const {
  if (refusing_) return true;
  const Reading reading(database_.reader());
  return count_queued(reading.connection()) >= options_.max_queued;
}

void SqliteJobStore::refuse_new() { refusing_ = true; }

void SqliteJobStore::close() {
  refusing_ = true;
  log_.close();
  wake_workers();
}

bool SqliteJobStore::wait_for_work(const std::stop_token& stop, std::chrono::milliseconds longest) {
  const auto deadline = std::chrono::steady_clock::now() + longest;
  while (!stop.stop_requested()) {
    Lock lock(work_mutex_);
    const std::uint64_t generation = work_generation_;
    lock.unlock();
    auto until = deadline;
    {
      const Reading reading(database_.reader());
      Query query = reading->query(
          "SELECT min(not_before) FROM jobs q WHERE state = 0 AND NOT EXISTS (SELECT 1 FROM jobs r "
          "WHERE r.owner = q.owner AND r.result_key = q.result_key AND r.state = 1)");
      query.next();
      if (!query.is_null(0)) {
        const auto wait = std::chrono::microseconds(query.integer(0) - now_us());
        if (wait.count() <= 0 || wait.count() > kLongestWaitUs) return true;
        until = std::min(until, std::chrono::steady_clock::now() + wait);
      }
    }
    if (std::chrono::steady_clock::now() >= deadline) return false;
    lock.lock();
    if (work_.wait_until(lock, stop, until, [&]() ISOMESH_REQUIRES(work_mutex_) {
          return work_generation_ != generation;
        })) {
      return true;
    }
  }
  return false;
}

// For one job that has become ready: others would find nothing.
void SqliteJobStore::wake_a_worker() {
  const Lock lock(work_mutex_);
  ++work_generation_;
  work_.notify_one();
}

void SqliteJobStore::wake_workers() {
  const Lock lock(work_mutex_);
  ++work_generation_;
  work_.notify_all();
}

SqliteJobStore::Row SqliteJobStore::row_of(const Query& query) {
  Row row;
  row.job = job_from_record(query.text(0));
  row.owner = query.text(1);
  row.result_key = query.text(2);
  row.accepted = query.integer(3);
  row.attempts = static_cast<int>(query.integer(4));
  row.fence = static_cast<std::uint64_t>(query.integer(5));
  row.cancelling = query.integer(6) != 0;
  return row;
}

std::optional<SqliteJobStore::Row> SqliteJobStore::find(Connection& connection,
                                                        const Viewer& viewer,
                                                        const std::string& id) {
  Query query = connection.query(std::string("SELECT ") + kRowColumns +
                                     " FROM jobs WHERE id = ?1 AND (?2 IS NULL OR owner = ?2)",
                                 id, viewer);
  if (!query.next()) return std::nullopt;
  return row_of(query);
}

SqliteJobStore::Row SqliteJobStore::found(Connection& connection, const Viewer& viewer,
                                          const std::string& id) {
  if (auto row = find(connection, viewer, id)) return std::move(*row);
  Query expired = connection.query(
      "SELECT 1 FROM expired WHERE id = ?1 AND (?2 IS NULL OR owner = ?2)", id, viewer);
  throw_no_job(expired.next());
}

Job SqliteJobStore::with_progress(const Row& row) const {
  Job job = row.job;
  if (job.state == JobState::kQueued && !blobs_.has_room()) job.waiting_for = WaitingFor::kDisk;
  const Lock lock(live_mutex_);
  const auto live = live_.find(job.id);
  const bool is_told = job.state == JobState::kRunning && live != live_.end() &&
                       live->second.fence == row.fence && live->second.progress;
  if (!is_told) return job;
  give_progress(job, *live->second.progress);
  return job;
}

void SqliteJobStore::Change::announce(const Row& row, EventKind kind) {
  const std::uint64_t id = log_.reserve({.id = 0,
                                         .owner = row.owner,
                                         .job = row.job.id,
                                         .kind = kind,
                                         .state = row.job.state,
                                         .stage = row.job.stage,
                                         .progress = row.job.progress});
  ++announced_;
  transaction_->run("INSERT INTO events VALUES(?, ?, ?, ?, ?, ?, ?)", id, row.owner, row.job.id,
                    kind, row.job.state, row.job.stage, row.job.progress);
}

std::size_t count_queued(Connection& connection) {
  Query query = connection.query("SELECT count(*) FROM jobs WHERE state = 0");
  query.next();
  return static_cast<std::size_t>(query.integer(0));
}

QueueShare share_of_queue(Connection& connection, const JobSpec& spec) {
  const bool is_stat = spec.parameters.priority == Priority::kStat;
  Query query = connection.query(
      "SELECT count(*), sum(owner = ?1) FROM jobs WHERE state = 0 AND (?2 = 0 OR priority = ?3)",
      spec.owner, is_stat, Priority::kStat);
  query.next();
  return {static_cast<std::size_t>(query.integer(0)), static_cast<std::size_t>(query.integer(1))};
}

}  // namespace isomesh::store
