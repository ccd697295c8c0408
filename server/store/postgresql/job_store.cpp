// What can be asked about jobs. job_queue.cpp has what changes them, job_retention.cpp what removes
// them.
#include "server/store/postgresql/job_store.h"

#include <algorithm>

#include "base/clock.h"
#include "base/log.h"
#include "proto/json.h"
#include "server/store/job_rules.h"
#include "server/store/microseconds.h"
#include "server/store/postgresql/job_rows.h"

namespace isomesh::store::postgresql {
namespace {

Timing timing_of(const std::vector<double>& parts) {
  Timing timing;
  if (parts.size() != 6) return timing;
  timing.load = parts[0];
  timing.extract = parts[1];
  timing.smooth = parts[2];
  timing.simplify = parts[3];
  timing.encode = parts[4];
  timing.certify = parts[5];
  return timing;
}

}  // namespace

PostgresJobStore::PostgresJobStore(Database& database, const BlobStore& blobs,
                                   JobStoreOptions options)
    : database_(database),
      blobs_(blobs),
      options_(std::move(options)),
      feed_(database),
      messages_(database, [this](const News& news) { hear(news); }) {}

void PostgresJobStore::hear(const News& news) {
  {
    const Lock lock(live_mutex_);
    for (const std::string& job : news.cancelled) {
      const auto run = live_.find(job);
      // Renewed at once, it learns for certain whether it is to stop.
      if (run != live_.end()) run->second.lease_until = {};
    }
  }
  if (news.has_work) {
    const Lock lock(work_mutex_);
    ++work_generation_;
    work_.notify_all();
  }
  if (!news.has_events) return;
  try {
    feed_.fetch();
  } catch (const Error& error) {
    log_debug("job events could not be read and are retried: {}", error.what());
  }
}

Job PostgresJobStore::get(const Viewer& viewer, const std::string& id) const {
  return with_progress(found(viewer, id));
}

JobAccount PostgresJobStore::account(const std::string& id) const {
  const Row row = found(std::nullopt, id);
  return {with_progress(row), row.attempts};
}

std::vector<Job> PostgresJobStore::list(const Viewer& viewer, std::optional<JobState> state,
                                        const std::string& after, std::size_t limit) const {
  // A condition that is not there costs no index.
  Rows rows = database_.run(std::string(kRow) + "WHERE " +
                                (viewer ? "j.owner = $1::text" : "$1::text IS NULL") +
                                (state ? " AND j.state = $2::int" : " AND $2::int IS NULL") +
                                (after.empty() ? " AND $3::text = ''" : " AND j.id < $3::text") +
                                " ORDER BY j.id DESC LIMIT $4::bigint",
                            viewer, state, after, limit);
  std::vector<Job> jobs;
  while (rows.next()) jobs.push_back(with_progress(row_of(rows)));
  return jobs;
}

std::vector<Event> PostgresJobStore::events(const Viewer& viewer, const std::string& job,
                                            std::uint64_t since,
                                            std::chrono::milliseconds timeout) const {
  return feed_.events(viewer, job, since, timeout);
}

QueueDepth PostgresJobStore::depth(const Viewer& viewer) const {
  const std::string mine = viewer ? "owner = $1::text" : "$1::text IS NULL";
  Rows rows = database_.run(
      "SELECT state, priority, count(*), count(*) FILTER (WHERE waiting_for = $2::int) FROM jobs "
      "WHERE state < 2 AND " +
          mine + " GROUP BY state, priority",
      viewer, WaitingFor::kDisk);
  QueueDepth depth;
  while (rows.next()) {
    const auto count = static_cast<std::size_t>(rows.integer(2));
    if (rows.integer(0) == static_cast<int>(JobState::kRunning)) {
      depth.running += count;
      continue;
    }
    depth.queued.at(static_cast<std::size_t>(rows.integer(1))) = count;
    depth.waiting_for_disk += static_cast<std::size_t>(rows.integer(3));
  }
  return depth;
}

bool PostgresJobStore::is_full() const {
  if (refusing_) return true;
  Rows row = database_.run(
      "SELECT count(*) FROM (SELECT 1 FROM jobs WHERE state = 0 LIMIT $1::bigint) AS q",
      options_.max_queued);
  row.next();
  return static_cast<std::size_t>(row.integer(0)) >= options_.max_queued;
}

void PostgresJobStore::close() {
  refusing_ = true;
  feed_.close();
  wake_workers();
}

bool PostgresJobStore::wait_for_work(const std::stop_token& stop,
                                     std::chrono::milliseconds longest) {
  const auto deadline = std::chrono::steady_clock::now() + longest;
  while (!stop.stop_requested()) {
    Lock lock(work_mutex_);
    const std::uint64_t generation = work_generation_;
    lock.unlock();
    auto until = deadline;
    Rows row = database_.run(
        "SELECT min(not_before) - isomesh_now() FROM jobs j WHERE state = 0 AND NOT EXISTS (SELECT "
        "1 FROM runs r WHERE r.owner = j.owner AND r.result_key = j.result_key)");
    row.next();
    if (!row.is_null(0)) {
      const auto wait = std::chrono::microseconds(row.integer(0));
      if (wait.count() <= 0) return true;
      until = std::min(until, std::chrono::steady_clock::now() + wait);
    }
    if (std::chrono::steady_clock::now() >= deadline) return false;
    lock.lock();
    work_.wait_until(lock, stop, until, [&]() ISOMESH_REQUIRES(work_mutex_) {
      return work_generation_ != generation;
    });
  }
  return false;
}

void PostgresJobStore::wake_workers() {
  messages_.tell({.has_work = true, .has_events = true, .cancelled = {}});
  const Lock lock(work_mutex_);
  ++work_generation_;
  work_.notify_all();
}

PostgresJobStore::Row PostgresJobStore::row_of(const Rows& rows) const {
  Row row;
  row.job = job_from_record(rows.text(0));
  row.owner = rows.text(1);
  row.result_key = rows.text(2);
  row.accepted = rows.integer(3);
  row.attempts = static_cast<int>(rows.integer(4));
  row.fence = static_cast<std::uint64_t>(rows.integer(5));
  row.job.state = static_cast<JobState>(rows.integer(6));
  if (!rows.is_null(7)) row.job.waiting_for = static_cast<WaitingFor>(rows.integer(7));
  if (row.job.state != JobState::kRunning || rows.is_null(8)) return row;
  row.job.stage = Stage::kLoad;
  row.job.started = timestamp_of_us(rows.integer(8));
  if (!rows.is_null(9)) {
    row.job.stage = static_cast<Stage>(rows.integer(9));
    row.job.progress = rows.real(10);
    row.job.timing = timing_of(rows.reals(11));
  }
  row.job.timing.queue = milliseconds_between(row.accepted, rows.integer(8));
  return row;
}

std::optional<PostgresJobStore::Row> PostgresJobStore::find(const Viewer& viewer,
                                                            const std::string& id) const {
  Rows rows = database_.run(
      std::string(kRow) + "WHERE j.id = $1::text AND ($2::text IS NULL OR j.owner = $2::text)", id,
      viewer);
  if (!rows.next()) return std::nullopt;
  return row_of(rows);
}

PostgresJobStore::Row PostgresJobStore::found(const Viewer& viewer, const std::string& id) const {
  if (auto row = find(viewer, id)) return std::move(*row);
  throw_no_job(database_
                   .run("SELECT 1 FROM expired WHERE id = $1::text AND ($2::text IS NULL OR owner "
                        "= $2::text)",
                        id, viewer)
                   .next());
}

// What this process knows of its own runs is newer than what it has told.
Job PostgresJobStore::with_progress(const Row& row) const {
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

double milliseconds_between(std::int64_t begin_us, std::int64_t end_us) {
  return static_cast<double>(std::max<std::int64_t>(end_us - begin_us, 1)) / 1000;
}

NamedBlobs blobs_of(const MeshSummary* mesh) {
  NamedBlobs blobs;
  if (mesh == nullptr) return blobs;
  for (const auto& [format, file] : mesh->files) {
    blobs.keys.push_back(file.sha256);
    blobs.bytes.push_back(static_cast<std::int64_t>(file.bytes));
  }
  return blobs;
}

std::string timestamp_of_us(std::int64_t us) { return timestamp_of(store::from_us(us)); }

}  // namespace isomesh::store::postgresql
