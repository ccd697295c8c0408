// Queries about jobs; changes are in job_queue.cpp.
#include "server/store/postgresql/job_store.h"

#include <algorithm>

#include "base/clock.h"
#include "base/log.h"
#include "proto/json.h"
#include "server/store/job_rules.h"
#include "server/store/microseconds.h"
#include "server/store/postgresql/held_task.h"

namespace isomesh::store::postgresql {
namespace {

// Damaged times must not hide the job.
Timing readable_timing(const std::string& record) {
  try {
    return timing_from_record(record);
  } catch (const Error&) {
    return {};
  }
}

}  // namespace

PostgresJobStore::PostgresJobStore(Database& database, BlobStore& blobs, JobStoreOptions options)
    : SqlJobStore(database, blobs, std::move(options),
                  "SELECT j.record, j.owner, j.result_key, j.accepted, j.attempts, j.fence, "
                  "j.state, j.waiting_for, r.claimed, r.stage, r.progress, r.timings, "
                  "j.id, j.state, j.volume, j.priority, j.version FROM jobs j "
                  "LEFT JOIN runs r ON r.job = j.id "),
      database_(database),
      feed_(database),
      messages_(database, [this](const News& news) { return on_news(news); }) {}

// Returns true if other processes run jobs, so that their progress should be read.
bool PostgresJobStore::on_news(const News& news) {
  {
    const Lock lock(live_mutex_);
    for (const std::string& job : news.cancelled) {
      const auto run = live_.find(job);
      // Forces a renewal, which tells for certain whether the run should stop.
      if (run != live_.end()) run->second.lease_until = {};
    }
  }
  if (news.has_work) wake_all_workers();
  try {
    if (news.has_events) feed_.fetch();
    if (news.has_progress) feed_.look_at_runs();
  } catch (const Error& error) {
    log_debug("job events could not be read and are retried: {}", error.what());
  }
  return feed_.has_runs_elsewhere();
}

void PostgresJobStore::wake_workers() {
  messages_.tell({.has_work = true, .has_events = true, .cancelled = {}});
  wake_all_workers();
}

std::optional<std::chrono::microseconds> PostgresJobStore::until_ready() const {
  Rows row = database_.query(
      "SELECT min(not_before) - isomesh_now() FROM jobs j WHERE state = {job.queued} AND "
      "version <= ?1 AND NOT EXISTS (SELECT 1 FROM runs r WHERE r.owner = j.owner AND "
      "r.result_key = j.result_key)",
      options_.job_version);
  row.next();
  if (row.is_null(0)) return std::nullopt;
  return std::chrono::microseconds(row.integer(0));
}

std::shared_ptr<const void> PostgresJobStore::claim_removal() {
  auto task = std::make_shared<ExclusiveTask>(database_.url(), "removing");
  if (!task->is_ours()) return nullptr;
  return task;
}

std::optional<Steady> PostgresJobStore::oldest_run() const {
  Rows row = database_.query("SELECT min(claimed) FROM runs");
  row.next();
  if (row.is_null(0)) return std::nullopt;
  return database_.steady_of(row.integer(0));
}

void PostgresJobStore::forget_events(Time before) {
  database_.run(Change::kRepeatable, "DELETE FROM events WHERE at < ?1", database_.to_us(before));
}

PostgresJobStore::Row PostgresJobStore::row_of(const Rows& rows) const {
  Row row = read_row(rows, 12, rows.integer(16) > options_.job_version);
  row.job.state = rows.choice(6, JobState::kCancelled);
  if (!rows.is_null(7)) row.job.waiting_for = rows.choice(7, WaitingFor::kDisk);
  if (row.job.state != JobState::kRunning || rows.is_null(8)) return row;
  start_run(row.job, row.accepted, rows.integer(8));
  if (!rows.is_null(9)) {
    row.job.stage = rows.stage(9);
    row.job.progress = rows.real(10);
    give_timing(row.job, readable_timing(rows.text(11)));
  }
  return row;
}

}  // namespace isomesh::store::postgresql
