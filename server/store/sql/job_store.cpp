#include "server/store/sql/job_store.h"

#include <algorithm>
#include <cmath>

#include "base/share.h"
#include "proto/error.h"
#include "proto/json.h"
#include "server/store/damaged_records.h"
#include "server/store/job_rules.h"
#include "server/store/sql/expiry.h"
#include "server/store/sql/job_list.h"
#include "server/store/sql/undamaged_rows.h"

namespace isomesh::store {
namespace {

constexpr DamagedTable kJobs = {"jobs", "SELECT record FROM jobs j", "j.id", "j.id DESC"};
// Minimum interval between progress events of a run.
constexpr std::chrono::milliseconds kBetweenProgressEvents{100};

// Cost of a job's turn: its expected run time, between 1 ms and a day, so that no job is free.
std::int64_t turn_cost_us(double expected_ms) {
  constexpr double kLeast = 1;
  constexpr double kMost = 24.0 * 3600 * 1000;
  const double bounded = std::isnan(expected_ms) ? kMost : std::clamp(expected_ms, kLeast, kMost);
  return std::llround(bounded * 1000);
}

[[noreturn]] void throw_missing_job(SqlConnection& connection, const Viewer& viewer,
                                    const std::string& id) {
  if (has_expired(connection, viewer, id)) throw Error(ErrorCode::kGone, "the job has expired");
  throw Error(ErrorCode::kNotFound, "there is no job with this id");
}

}  // namespace

// --- Queries

SqlJobStore::Row SqlJobStore::intact(Row row) {
  if (row.is_newer && row.is_damaged) {
    throw Error(ErrorCode::kUnavailable,
                "a newer version of the service accepted this job, and this daemon cannot read "
                "it: try again");
  }
  if (row.is_damaged) throw_damaged_job();
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

std::vector<Job> SqlJobStore::list(const Viewer& viewer, const JobFilter& filter,
                                   const std::string& after, std::size_t limit) const {
  return list_despite_damage([&] { return list_after(viewer, filter, after, limit); },
                             [&] { return undamaged_after(viewer, filter, after, limit); });
}

std::vector<Job> SqlJobStore::list_after(const Viewer& viewer, const JobFilter& filter,
                                         const std::string& after, std::size_t limit) const {
  const JobListValues values(filter);
  std::vector<Job> jobs;
  std::string last = after;
  // Repeats only if damaged records were skipped, because fewer than `limit` jobs mean the end of
  // the list.
  for (bool is_over = false; !is_over && jobs.size() < limit;) {
    std::size_t left = std::min<std::size_t>(limit - jobs.size(), 1 << 30);
    Rows rows =
        records_.query(select_ + job_list_query(viewer, filter, last), viewer, filter.state, last,
                       left, values.volume, values.since, values.until, values.first_id);
    for (; rows.next(); --left) {
      const Row row = row_of(rows);
      last = row.job.id;
      if (!row.is_damaged) jobs.push_back(with_progress(row));
    }
    is_over = left > 0;
  }
  return jobs;
}

std::vector<Job> SqlJobStore::undamaged_after(const Viewer& viewer, const JobFilter& filter,
                                              const std::string& after, std::size_t limit) const {
  const JobListValues values(filter);
  std::map<std::string, Row> found;
  const auto take = [&](const Rows& rows) {
    Row row = row_of(rows);
    if (!row.is_damaged) found.emplace(row.job.id, std::move(row));
    if (found.size() > limit) found.erase(found.begin());
  };
  read_undamaged(records_, kJobs,
                 select_ +
                     "WHERE (?1 IS NULL OR j.owner = ?1) AND (?2 IS NULL OR j.state = ?2) AND (?3 "
                     "= '' OR j.id < ?3) AND (?4 IS NULL OR j.volume = ?4) AND (?5 IS NULL OR "
                     "j.accepted >= ?5) AND (?6 IS NULL OR j.accepted < ?6)",
                 take, viewer, filter.state, after, values.volume, values.since, values.until);
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
  throw_missing_job(connection, viewer, id);
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

// --- Submissions

Submission SqlJobStore::submit(const JobSpec& spec) {
  constexpr int kTries = 20;
  for (int tries = 0; tries < kTries; ++tries) {
    if (auto submission = try_to_submit(spec, true)) return *std::move(submission);
  }
  // Equal jobs come and go all the time, so another run makes the mesh.
  return try_to_submit(spec, false).value();
}

std::optional<SqlJobStore::Made> SqlJobStore::made_like(const std::string& owner,
                                                        const std::string& result_key) const {
  Rows row = records_.query(
      select_ +
          "WHERE j.owner = ?1 AND j.result_key = ?2 AND j.state = {job.succeeded} ORDER BY j.id "
          "DESC LIMIT 1",
      owner, result_key);
  if (!row.next()) return std::nullopt;
  const Job job = row_of(row).job;
  Made made = {job.id, job.mesh};
  if (made.mesh && !is_intact(*made.mesh, blobs_)) made.mesh.reset();
  return made;
}

std::optional<SqlJobStore::Asked> SqlJobStore::look_up(SqlConnection& connection,
                                                       const JobSpec& spec) const {
  Rows row = connection.query("SELECT record FROM volumes WHERE owner = ?1 AND id = ?2", spec.owner,
                              spec.parameters.volume);
  if (!row.next()) return std::nullopt;
  const auto volume = readable_volume(row.text(0), spec.parameters.volume);
  if (!volume) throw_damaged_volume("volume");
  return Asked{.result_key = result_key(*volume, spec.parameters, options_.mesher_version),
               .cost_us = turn_cost_us(options_.expected_ms(*volume, spec.parameters))};
}

void SqlJobStore::throw_no_volume_of(SqlConnection& connection, const JobSpec& spec) {
  const bool is_gone = has_expired(connection, spec.owner, spec.parameters.volume);
  const std::string detail =
      is_gone ? "the volume has expired: upload it again" : "there is no volume with this id";
  throw Error(is_gone ? ErrorCode::kGone : ErrorCode::kNotFound, detail, {{"volume", detail}});
}

// Urgent jobs share an eighth of the queue, because all others wait for them. One place would be
// the first owner's alone.
std::size_t SqlJobStore::most_queued(Priority priority) const {
  constexpr std::size_t kStatShare = 8;
  constexpr std::size_t kLeast = 2;
  if (priority != Priority::kStat) return options_.max_queued;
  return std::min(std::max(options_.max_queued / kStatShare, kLeast), options_.max_queued);
}

std::optional<Submission::Kind> SqlJobStore::find_no_room(SqlConnection& connection,
                                                          const JobSpec& spec) const {
  if (spec.owner.empty()) return std::nullopt;
  const bool is_stat = spec.parameters.priority == Priority::kStat;
  Rows row = connection.query(
      "SELECT count(*), count(CASE WHEN owner = ?1 THEN 1 END) FROM jobs WHERE state = "
      "{job.queued} AND (?2 = 0 OR priority = ?3)",
      spec.owner, is_stat, Priority::kStat);
  row.next();
  const std::size_t room = most_queued(spec.parameters.priority);
  const std::size_t held = row.count(1);
  if (has_share(spec.owner, held, room - std::min(room, row.count(0)))) return std::nullopt;
  return held > 0 ? Submission::Kind::kOwnersShare : Submission::Kind::kBusy;
}

bool SqlJobStore::is_repaired(const Job& job) const {
  if (!job.error || to_error(*job.error).code() != ErrorCode::kUnusableVolume) return false;
  Rows row =
      records_.query("SELECT blob FROM volumes WHERE id = ?1 LIMIT 1", job.parameters.volume);
  return row.next() && is_there_and_intact(blobs_, row.text(0), {});
}

Job SqlJobStore::remake(const std::string& id) {
  JobSpec spec;
  const auto like = records_.read([&](SqlConnection& connection) -> std::optional<Job> {
    const Row row = intact(found(connection, std::nullopt, id));
    spec.owner = row.owner;
    spec.parameters = row.job.parameters;
    spec.parameters.callback.reset();
    const auto asked = look_up(connection, spec);
    if (asked && row.result_key != asked->result_key) {
      throw Error(ErrorCode::kGone,
                  "the stored mesh is damaged, and this version would make a different one: submit "
                  "the job again");
    }
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
  const auto is_whole = [&] { return like->mesh && is_intact(*like->mesh, blobs_); };
  if (like && !is_repaired(*like) && (like->error || !is_final(like->state) || is_whole())) {
    return *like;
  }
  try {
    return job_of(submit(spec));
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kNotFound && error.code() != ErrorCode::kGone) throw;
    throw Error(
        ErrorCode::kGone,
        "the stored mesh is damaged, and its volume no longer exists: upload the volume again");
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

// --- Erasure, expiry and statistics of ended jobs

bool SqlJobStore::erase(const Viewer& viewer, const std::string& id, const BlobsGoing& going) {
  return records_.change(Change::kNeeded, [&](SqlTransaction& transaction) {
    SqlConnection& connection = transaction.connection();
    // Does not read the record, so that damaged ones can be erased too.
    const auto state = [&]() -> std::optional<JobState> {
      Rows row = connection.query(
          std::string("SELECT state FROM jobs WHERE id = ?1 AND (?2 IS NULL OR owner = ?2)") +
              connection.for_update(),
          id, viewer);
      return row.next() ? std::optional(row.choice(0, JobState::kCancelled)) : std::nullopt;
    }();
    if (!state && transaction.is_again()) return true;
    if (!state) throw_missing_job(connection, viewer, id);
    if (!is_final(*state)) return false;
    erase_jobs(connection, std::span(&id, 1), going);
    transaction.commit();
    return true;
  });
}

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
        if (removed > 0) delete_events_before_end(connection, job.id);
        return removed == 0 ? std::nullopt : std::optional(std::move(blobs));
      });
}

std::uint64_t SqlJobStore::named_bytes() const { return sum_of_blobs(records_, "meshes", "blob"); }

OwnedBytes SqlJobStore::owned_bytes() const {
  return read_owned_bytes(records_.query(
      "SELECT owner, sum(bytes) FROM (SELECT owner, max(bytes) AS bytes FROM meshes JOIN jobs ON "
      "job = id GROUP BY owner, blob) AS each GROUP BY owner"));
}

void SqlJobStore::forget_expired(Time before) {
  records_.run(Change::kRepeatable, "DELETE FROM expired WHERE at < ?1", records_.to_us(before));
}

}  // namespace isomesh::store
