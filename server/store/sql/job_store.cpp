#include "server/store/sql/job_store.h"

#include <algorithm>

#include "proto/error.h"
#include "proto/json.h"
#include "server/store/damaged_records.h"
#include "server/store/job_rules.h"
#include "server/store/sql/expiry.h"
#include "server/store/sql/undamaged_rows.h"

namespace isomesh::store {
namespace {

constexpr DamagedTable kJobs = {"jobs", "SELECT record FROM jobs j", "j.id", "j.id DESC"};

}  // namespace

// --- Queries

SqlJobStore::Row SqlJobStore::intact(Row row) {
  if (row.is_damaged) row.is_newer ? throw_newer_job() : throw_damaged_job();
  return row;
}

Job SqlJobStore::get(const Viewer& viewer, const std::string& id) const {
  return records_.read([&](SqlConnection& connection) {
    return with_progress(intact(found(connection, viewer, id)));
  });
}

JobAccount SqlJobStore::account(const std::string& id) const {
  return records_.read([&](SqlConnection& connection) {
    const Row row = intact(found(connection, std::nullopt, id));
    return JobAccount{with_progress(row), row.attempts};
  });
}

std::vector<Job> SqlJobStore::list(const Viewer& viewer, std::optional<JobState> state,
                                   const std::string& after, std::size_t limit) const {
  return list_despite_damage([&] { return list_after(viewer, state, after, limit); },
                             [&] { return undamaged_after(viewer, state, after, limit); });
}

std::vector<Job> SqlJobStore::list_after(const Viewer& viewer, std::optional<JobState> state,
                                         const std::string& after, std::size_t limit) const {
  std::vector<Job> jobs;
  std::string last = after;
  // Repeats only if damaged records were skipped, because fewer than `limit` jobs mean the end of
  // the list.
  for (bool is_over = false; !is_over && jobs.size() < limit;) {
    // Conditions that are absent from the text let the query use an index.
    std::size_t left = std::min<std::size_t>(limit - jobs.size(), 1 << 30);
    Rows rows = records_.query(select_ + "WHERE " + (viewer ? "j.owner = ?1" : "?1 IS NULL") +
                                   (state ? " AND j.state = ?2" : " AND ?2 IS NULL") +
                                   (last.empty() ? " AND ?3 = ''" : " AND j.id < ?3") +
                                   " ORDER BY j.id DESC LIMIT ?4",
                               viewer, state, last, left);
    for (; rows.next(); --left) {
      const Row row = row_of(rows);
      last = row.job.id;
      if (!row.is_damaged) jobs.push_back(with_progress(row));
    }
    is_over = left > 0;
  }
  return jobs;
}

std::vector<Job> SqlJobStore::undamaged_after(const Viewer& viewer, std::optional<JobState> state,
                                              const std::string& after, std::size_t limit) const {
  std::map<std::string, Row> found;
  const auto take = [&](const Rows& rows) {
    Row row = row_of(rows);
    if (!row.is_damaged) found.emplace(row.job.id, std::move(row));
    if (found.size() > limit) found.erase(found.begin());
  };
  read_undamaged(records_, kJobs,
                 select_ +
                     "WHERE (?1 IS NULL OR j.owner = ?1) AND (?2 IS NULL OR j.state = ?2) AND (?3 "
                     "= '' OR j.id < ?3)",
                 take, viewer, state, after);
  std::vector<Job> jobs;
  for (const auto& [id, row] : found) jobs.push_back(with_progress(row));
  std::ranges::reverse(jobs);
  return jobs;
}

QueueDepth SqlJobStore::depth(const Viewer& viewer) const {
  const std::string mine = viewer ? " AND owner = ?1" : " AND ?1 IS NULL";
  Rows rows = records_.query(
      "SELECT 'queued', priority, count(*) FROM jobs WHERE state = {job.queued}" + mine +
          " GROUP BY priority UNION ALL SELECT 'running', 0, count(*) FROM jobs WHERE state = "
          "{job.running}" +
          mine +
          " UNION ALL SELECT 'waiting', 0, count(*) FROM jobs WHERE state = {job.queued} AND "
          "waiting_for IS "
          "NOT NULL AND waiting_for = ?2" +
          mine,
      viewer, WaitingFor::kDisk);
  QueueDepth depth;
  while (rows.next()) {
    const std::string what = rows.text(0);
    // A damaged number counts as the last priority.
    const std::size_t priority = std::min(rows.count(1), depth.queued.size() - 1);
    std::size_t& count = what == "running"   ? depth.running
                         : what == "waiting" ? depth.waiting_for_disk
                                             : depth.queued[priority];
    count += rows.count(2);
  }
  return depth;
}

bool SqlJobStore::is_full() const {
  return refusing_ ||
         records_.read([this](SqlConnection& connection) { return is_full(connection); });
}

bool SqlJobStore::is_full(SqlConnection& connection) const {
  Rows row = connection.query("SELECT count(*) FROM jobs WHERE state = {job.queued}");
  row.next();
  return row.count(0) >= options_.max_queued;
}

std::optional<SqlJobStore::Row> SqlJobStore::find(SqlConnection& connection, const Viewer& viewer,
                                                  const std::string& id) const {
  Rows rows =
      connection.query(select_ + "WHERE j.id = ?1 AND (?2 IS NULL OR j.owner = ?2)", id, viewer);
  if (!rows.next()) return std::nullopt;
  return row_of(rows);
}

SqlJobStore::Row SqlJobStore::found(SqlConnection& connection, const Viewer& viewer,
                                    const std::string& id) const {
  if (auto row = find(connection, viewer, id)) return *std::move(row);
  throw_no_job(has_expired(connection, viewer, id));
}

SqlJobStore::Row SqlJobStore::read_row(const Rows& rows, int columns, bool is_newer) {
  Row row;
  row.owner = rows.text(1);
  row.result_key = rows.text(2);
  row.accepted = rows.integer(3);
  row.attempts = static_cast<int>(rows.integer(4));
  row.fence = static_cast<std::uint64_t>(rows.integer(5));
  const JobColumns known = {.id = rows.text(columns),
                            .state = rows.choice(columns + 1, JobState::kCancelled),
                            .volume = rows.text(columns + 2),
                            .priority = rows.choice(columns + 3, Priority::kBulk),
                            .accepted_us = row.accepted};
  row.is_newer = is_newer;
  if (is_newer) row.record = rows.text(0);
  auto job = readable_job(rows.text(0), known.id, known.volume, is_newer);
  row.is_damaged = !job;
  row.job = job ? *std::move(job) : damaged_job(known);
  return row;
}

Job SqlJobStore::repair_ended(SqlConnection& connection, const Row& row) const {
  Job job = row.job;
  job.state = JobState::kCancelled;
  job.finished = job.created;
  job.error.reset();
  connection.run("UPDATE jobs SET state = ?1, record = ?2 WHERE id = ?3 AND state >= {job.final}",
                 job.state, to_record(job), job.id);
  return job;
}

Job SqlJobStore::with_progress(const Row& row) const {
  Job job = row.job;
  if (job.state == JobState::kQueued && !blobs_.has_room()) job.waiting_for = WaitingFor::kDisk;
  const Lock lock(live_mutex_);
  const auto live = live_.find(job.id);
  const bool is_told = job.state == JobState::kRunning && live != live_.end() &&
                       live->second.fence == row.fence && live->second.progress;
  if (is_told) give_progress(job, *live->second.progress);
  return job;
}

// --- Before a submission

std::optional<SqlJobStore::Asked> SqlJobStore::look_up(SqlConnection& connection,
                                                       const JobSpec& spec) const {
  Rows row = connection.query("SELECT record FROM volumes WHERE owner = ?1 AND id = ?2", spec.owner,
                              spec.parameters.volume);
  if (!row.next()) return std::nullopt;
  const auto volume = readable_volume(row.text(0), spec.parameters.volume);
  if (!volume) throw_damaged_volume("volume");
  return Asked{.result_key = result_key(spec.parameters.volume, volume->notes, spec.parameters,
                                        options_.mesher_version),
               .cost_us = turn_cost_us(options_.expected_ms(*volume, spec.parameters))};
}

void SqlJobStore::throw_no_volume_of(SqlConnection& connection, const JobSpec& spec) {
  throw_no_volume(has_expired(connection, spec.owner, spec.parameters.volume));
}

bool SqlJobStore::has_share(SqlConnection& connection, const JobSpec& spec) const {
  if (spec.owner.empty()) return true;
  Rows row = connection.query(
      "SELECT count(*), count(CASE WHEN owner = ?1 THEN 1 END) FROM jobs WHERE state = "
      "{job.queued} AND (?2 = "
      "0 OR priority = ?3)",
      spec.owner, spec.parameters.priority == Priority::kStat, Priority::kStat);
  row.next();
  return has_share_of_queue(spec, {row.count(0), row.count(1)}, options_.max_queued);
}

bool SqlJobStore::is_repaired(const Job& job) const {
  return job.error && to_error(*job.error).code() == ErrorCode::kUnusableVolume &&
         is_there_and_intact(blobs_, job.parameters.volume, {});
}

bool SqlJobStore::is_whole(const Job& job) const {
  const auto is_intact = [this](const std::string& blob) {
    return is_there_and_intact(blobs_, blob, {});
  };
  if (!job.mesh || (job.mesh->label_list && !is_intact(job.mesh->label_list->sha256))) return false;
  return std::ranges::all_of(job.mesh->files,
                             [&](const auto& file) { return is_intact(file.second.sha256); });
}

Job SqlJobStore::remake(const std::string& id) {
  JobSpec spec;
  const auto like = records_.read([&](SqlConnection& connection) -> std::optional<Job> {
    const Row row = intact(found(connection, std::nullopt, id));
    spec.owner = row.owner;
    spec.parameters = row.job.parameters;
    spec.parameters.callback.reset();
    const auto asked = look_up(connection, spec);
    if (asked && row.result_key != asked->result_key) throw_other_version();
    Rows rows = connection.query(
        select_ +
            "WHERE j.owner = ?1 AND j.result_key = ?2 AND j.id > ?3 ORDER BY j.id DESC LIMIT 1",
        row.owner, row.result_key, id);
    if (!rows.next()) return std::nullopt;
    const Row latest = row_of(rows);
    return latest.is_damaged ? std::nullopt : std::optional(with_progress(latest));
  });
  // Outside the transaction, because this may read the whole volume or the files. The job that
  // makes it again may have ended since the damage was seen.
  if (like && !is_repaired(*like) && (like->error || !is_final(like->state) || is_whole(*like))) {
    return *like;
  }
  try {
    return job_of(submit(spec));
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kNotFound && error.code() != ErrorCode::kGone) throw;
    throw_volume_gone();
  }
}

// --- Runs of this process, and waiting workers

SqlJobStore::Live* SqlJobStore::live(const std::string& id, std::uint64_t fence) {
  const auto run = live_.find(id);
  return run != live_.end() && run->second.fence == fence ? &run->second : nullptr;
}

void SqlJobStore::note(const Lease& lease, const Progress& progress) {
  const Steady now = Steady::clock::now();
  bool is_other_stage = false;
  std::int64_t transaction = 0;
  {
    const Lock lock(live_mutex_);
    Live* const run = live(lease.id, lease.fence);
    if (run == nullptr) return;
    const Progress before = run->progress.value_or(Progress{});
    is_other_stage = before.stage != progress.stage;
    const bool is_further = before.share != progress.share;
    run->progress = progress;
    if (!is_other_stage && (!is_further || now < run->told + kBetweenProgressEvents)) return;
    run->told = now;
    transaction = run->transaction;
  }
  tell({.id = 0,
        .owner = lease.owner,
        .job = lease.id,
        .kind = is_other_stage ? EventKind::kStage : EventKind::kProgress,
        .state = JobState::kRunning,
        .stage = progress.stage,
        .progress = progress.share},
       transaction);
}

void SqlJobStore::forget_run(const std::string& id, std::uint64_t fence) {
  const Lock lock(live_mutex_);
  if (live(id, fence) != nullptr) live_.erase(id);
}

bool SqlJobStore::wait_for_work(const std::stop_token& stop, std::chrono::milliseconds longest) {
  const Steady deadline = Steady::clock::now() + longest;
  while (!stop.stop_requested()) {
    Lock lock(work_mutex_);
    const std::uint64_t generation = work_generation_;
    lock.unlock();
    Steady until = deadline;
    if (const auto wait = until_ready()) {
      if (wait->count() <= 0) return true;
      until = std::min(until, Steady::clock::now() + *wait);
    }
    if (Steady::clock::now() >= deadline) return false;
    lock.lock();
    work_.wait_until(lock, stop, until, [&]() ISOMESH_REQUIRES(work_mutex_) {
      return work_generation_ != generation;
    });
  }
  return false;
}

void SqlJobStore::wake_a_worker() {
  const Lock lock(work_mutex_);
  ++work_generation_;
  work_.notify_one();
}

void SqlJobStore::wake_all_workers() {
  const Lock lock(work_mutex_);
  ++work_generation_;
  work_.notify_all();
}

void SqlJobStore::close() {
  refusing_ = true;
  close_events();
  wake_all_workers();
}

// --- Expiry and statistics of ended jobs

std::vector<Expirable> SqlJobStore::ended(const ExpiryFilter& filter, Ended which,
                                          std::size_t limit) const {
  return read_expirable(
      records_, RecordKind::kJob,
      records_.query(
          "SELECT owner, id, finished FROM jobs WHERE finished < ?1 AND (?2 = 0 OR EXISTS (SELECT "
          "1 FROM meshes WHERE job = jobs.id)) AND (?4 IS NULL OR owner = ?4) ORDER BY finished "
          "LIMIT ?3",
          records_.to_us(filter.before), which == Ended::kWithMesh, limit, filter.owner));
}

Expired SqlJobStore::expire(std::span<const Expirable> jobs, std::uint64_t enough) {
  return expire_records(
      records_, jobs, enough, [](SqlConnection& connection, const Expirable& job) {
        std::vector<Blob> blobs =
            read_blobs(connection.query("SELECT blob, bytes FROM meshes WHERE job = ?1", job.id));
        const std::size_t removed =
            connection.run("DELETE FROM jobs WHERE id = ?1 AND finished IS NOT NULL", job.id);
        if (removed > 0) connection.run("DELETE FROM events WHERE job = ?1", job.id);
        return removed == 0 ? std::nullopt : std::optional(std::move(blobs));
      });
}

std::uint64_t SqlJobStore::named_bytes() const {
  Rows row = records_.query(
      "SELECT coalesce(sum(bytes), 0) FROM (SELECT max(bytes) AS bytes FROM meshes GROUP BY blob) "
      "AS each");
  row.next();
  return row.count(0);
}

OwnedBytes SqlJobStore::owned_bytes() const {
  return read_owned_bytes(records_.query(
      "SELECT owner, sum(bytes) FROM (SELECT owner, max(bytes) AS bytes FROM meshes JOIN jobs ON "
      "job = id GROUP BY owner, blob) AS each GROUP BY owner"));
}

void SqlJobStore::forget_expired(Time before) {
  records_.run(Change::kRepeatable, "DELETE FROM expired WHERE at < ?1", records_.to_us(before));
}

double milliseconds_between(std::int64_t begin_us, std::int64_t end_us) {
  return static_cast<double>(std::max<std::int64_t>(end_us - begin_us, 1)) / 1000;
}

}  // namespace isomesh::store
