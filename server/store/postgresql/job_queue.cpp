// What changes jobs, one function of the database a verb; job_store.cpp has what can be asked,
// job_reuse.cpp which meshes serve more than one.
#include <algorithm>

#include "base/ids.h"
#include "proto/json.h"
#include "server/store/job_rules.h"
#include "server/store/microseconds.h"
#include "server/store/outbox.h"
#include "server/store/postgresql/job_rows.h"

namespace isomesh::store::postgresql {
namespace {

// How often a run tells the database how far it is, and learns that it is to stop if it missed
// what was told.
constexpr std::chrono::milliseconds kBetweenRenewals{1000};

std::vector<double> parts_of(const Timing& timing) {
  return {timing.load,     timing.extract, timing.smooth,
          timing.simplify, timing.encode,  timing.certify};
}

void end(Job& job, JobState state, std::int64_t accepted, std::int64_t now) {
  job.state = state;
  job.waiting_for.reset();
  job.finished = timestamp_of_us(now);
  job.timing.total = milliseconds_between(accepted, now);
}

}  // namespace

Submission PostgresJobStore::submit(const JobSpec& spec) {
  const std::int64_t now = database_.now_us();
  Job job;
  job.id = time_ordered_id(store::from_us(now));
  job.parameters = spec.parameters;
  job.created = timestamp_of_us(now);
  // Each time somebody else has made, or removed, the like of it meanwhile.
  for (int tries = 0; tries < 20; ++tries) {
    if (auto submission = try_to_submit(spec, job)) return std::move(*submission);
  }
  throw Error(ErrorCode::kUnavailable,
              "the same job is submitted and removed too often: try again");
}

std::optional<Submission> PostgresJobStore::try_to_submit(const JobSpec& spec, Job job) {
  enum Answer { kNew, kKnown, kOther, kFull, kNoVolume, kLookAgain, kShare };
  const std::int64_t accepted = database_.now_us();
  const std::string key = result_key_of(spec).value_or("");
  const auto made = made_like(spec.owner, key);
  const MeshSummary* mesh = made && made->mesh && !refusing_ ? &*made->mesh : nullptr;
  if (mesh != nullptr) {
    job.reused = true;
    give_mesh(job, *mesh);
    end(job, JobState::kSucceeded, accepted, database_.now_us());
  }
  const bool has_room = mesh != nullptr || blobs_.has_room();
  const std::size_t most = refusing_ || !has_room ? 0 : options_.max_queued;
  const auto& callback = spec.parameters.callback;
  const NamedBlobs blobs = blobs_of(mesh);
  Rows row = database_.run(
      "SELECT kind, job FROM submit_job($1::text, $2::text, $3::int, $4::text, $5::text, $6::text, "
      "$7::text, $8::text, $9::uuid, $10::int, $11::boolean, $12::text, $13::int, $14::text[], "
      "$15::bigint[], $16::text, $17::text, $18::bigint)",
      job.id, spec.owner, spec.parameters.priority, spec.parameters.volume, key,
      spec.idempotency_key.empty() ? std::nullopt : std::optional(spec.idempotency_key),
      spec.request_digest, to_json(job), database_.node(), most, has_share(spec),
      made ? std::optional(made->job) : std::nullopt, mesh != nullptr ? 2 : 0, blobs.keys,
      blobs.bytes, callback ? std::optional(receiver_of(callback->url)) : std::nullopt,
      callback ? std::optional(callback->url) : std::nullopt, accepted);
  row.next();
  switch (static_cast<Answer>(row.integer(0))) {
    case kNew:
      wake_workers();
      return Submission{Submission::Kind::kNew, job, {}};
    case kKnown:
      return Submission{Submission::Kind::kExisting, get(spec.owner, row.text(1)), {}};
    case kOther:
      return Submission{Submission::Kind::kConflict, {}, {}};
    case kFull:
      if (!has_room) {
        throw Error(ErrorCode::kOutOfSpace, "there is not enough disk space for another job");
      }
      return Submission{Submission::Kind::kBusy, {}, kRetryAfter};
    case kNoVolume:
      throw_no_volume(has_expired(spec));
    case kLookAgain:
      return std::nullopt;
    case kShare:
      return Submission{Submission::Kind::kOwnersShare, {}, kRetryAfter};
  }
  return std::nullopt;
}

bool PostgresJobStore::has_share(const JobSpec& spec) const {
  if (spec.owner.empty()) return true;
  const bool is_stat = spec.parameters.priority == Priority::kStat;
  Rows row = database_.run(
      "SELECT count(*), count(*) FILTER (WHERE owner = $1::text) FROM jobs WHERE state = 0 AND "
      "($2::boolean IS FALSE OR priority = $3::int)",
      spec.owner, is_stat, Priority::kStat);
  row.next();
  return has_share_of_queue(
      spec, {static_cast<std::size_t>(row.integer(0)), static_cast<std::size_t>(row.integer(1))},
      options_.max_queued);
}

std::optional<Lease> PostgresJobStore::claim(const std::string& worker,
                                             std::chrono::milliseconds lease) {
  Steady asked;
  std::optional<Rows> claimed = database_.ask([&](Connection& connection, bool is_again) {
    asked = Steady::clock::now();
    if (is_again) {
      // What it got when it was interrupted: a worker has one run at a time.
      Rows mine = connection.run(
          "SELECT j.id, r.fence, j.attempts, j.owner, j.record, j.accepted, r.claimed, 0 FROM runs "
          "r JOIN jobs j ON j.id = r.job WHERE r.node = $1::uuid AND r.worker = $2::text AND "
          "r.lease_until > isomesh_now() ORDER BY r.claimed DESC LIMIT 1",
          database_.node(), worker);
      if (mine.count() > 0) return std::optional(std::move(mine));
    }
    Rows rows = connection.run(
        "SELECT id, fence, attempts, owner, record, accepted, claimed, "
        "pg_current_xact_id_if_assigned()::text::bigint FROM claim_job($1::uuid, $2::text, "
        "$3::bigint)",
        database_.node(), worker, microseconds(lease));
    return rows.count() > 0 ? std::optional(std::move(rows)) : std::nullopt;
  });
  if (!claimed) return std::nullopt;
  claimed->next();
  Live run;
  run.job = job_from_record(claimed->text(4));
  run.fence = static_cast<std::uint64_t>(claimed->integer(1));
  run.accepted = claimed->integer(5);
  run.job.state = JobState::kRunning;
  run.job.stage = Stage::kLoad;
  run.job.waiting_for.reset();
  run.job.started = timestamp_of_us(claimed->integer(6));
  run.job.timing.queue = milliseconds_between(run.accepted, claimed->integer(6));
  run.claimed = asked;
  run.lease_until = asked + lease;
  run.transaction = claimed->integer(7);
  const Lease result = {claimed->text(0), run.fence, static_cast<int>(claimed->integer(2)),
                        claimed->text(3), run.job.parameters};
  {
    const Lock lock(live_mutex_);
    live_[result.id] = std::move(run);
  }
  messages_.tell({.has_work = false, .has_events = true, .cancelled = {}});
  return result;
}

Standing PostgresJobStore::renew(const Lease& lease, const Progress& progress,
                                 std::chrono::milliseconds length) {
  const Steady asked = Steady::clock::now();
  bool is_fresh = false;
  {
    const Lock lock(live_mutex_);
    const Live* const run = live(lease);
    if (run == nullptr) return Standing::kLost;
    const auto slack = std::min<std::chrono::milliseconds>(length / 3, kBetweenRenewals);
    const bool is_same_stage = run->progress && run->progress->stage == progress.stage;
    is_fresh = is_same_stage && run->lease_until >= asked + length - slack;
  }
  if (!is_fresh) {
    Rows row = database_.run(
        "SELECT renew_run($1::text, $2::bigint, $3::bigint, $4::int, $5::float8, $6::float8[])",
        lease.id, lease.fence, microseconds(length), progress.stage, progress.share,
        parts_of(progress.timing));
    row.next();
    if (row.is_null(0)) {
      forget_run(lease.id, lease.fence);
      return Standing::kLost;
    }
    const Lock lock(live_mutex_);
    Live* const run = live(lease);
    if (run == nullptr) return Standing::kLost;
    run->lease_until = asked + length;
    run->cancelling = run->cancelling || row.boolean(0);
  }
  tell(lease, progress);
  const Lock lock(live_mutex_);
  const Live* const run = live(lease);
  if (run == nullptr) return Standing::kLost;
  return run->cancelling ? Standing::kCancel : Standing::kOk;
}

bool PostgresJobStore::finish(const Lease& lease, const Outcome& outcome) {
  const auto run = live_run(lease);
  if (!run) return false;
  const std::int64_t now = database_.now_us();
  Job job = run->job;
  job.timing = outcome.timing;
  job.timing.queue = run->job.timing.queue;
  Ending ending;
  ending.cancelled = to_json(cancelled(job, run->accepted));
  if (!outcome.mesh && !outcome.error) {
    ending.state = JobState::kCancelled;
    ending.record = ending.cancelled;
  } else if (outcome.mesh) {
    ending.mesh = &*outcome.mesh;
    ending.state = JobState::kSucceeded;
    give_mesh(job, *outcome.mesh);
  } else if (outcome.may_retry && lease.attempt < options_.attempts) {
    ending.delay = delay_after(lease.attempt, options_);
    ending.counts = true;
  } else {
    ending.state = JobState::kFailed;
    job.error = outcome.error;
  }
  if (ending.state == JobState::kSucceeded || ending.state == JobState::kFailed) {
    end(job, ending.state, run->accepted, now);
    ending.record = to_json(job);
  }
  if (!end_run(lease.id, lease.fence, ending)) return false;
  if (outcome.mesh) {
    for (const auto& [format, file] : outcome.mesh->files) blobs_.settle(file.sha256);
  }
  return true;
}

bool PostgresJobStore::put_back(const Lease& lease, std::chrono::milliseconds delay,
                                std::optional<WaitingFor> waiting_for) {
  const auto run = live_run(lease);
  if (!run) return false;
  Ending ending;
  ending.cancelled = to_json(cancelled(run->job, run->accepted));
  ending.delay = delay;
  ending.waiting_for = waiting_for;
  return end_run(lease.id, lease.fence, ending);
}

std::size_t PostgresJobStore::reap() {
  Rows rows = database_.run(
      std::string(kRow) +
          "WHERE r.lease_until < isomesh_now() OR r.node IN (SELECT id FROM nodes WHERE name = "
          "$1::text AND id <> $2::uuid)",
      database_.node_name(), database_.node());
  std::size_t reaped = 0;
  while (rows.next()) {
    const Row row = row_of(rows);
    Ending ending;
    ending.ends_others = true;
    ending.cancelled = to_json(cancelled(row.job, row.accepted));
    if (end_run(row.job.id, row.fence, ending)) ++reaped;
  }
  return reaped;
}

// Asks until the database has been told of all jobs that end with it.
bool PostgresJobStore::end_run(const std::string& id, std::uint64_t fence, const Ending& ending) {
  enum Verdict { kLost, kDone, kThereAreAlike };
  const NamedBlobs blobs = blobs_of(ending.mesh);
  std::vector<std::string> alike;
  std::vector<std::string> records;
  bool is_again = false;
  while (true) {
    Rows rows = database_.ask([&](Connection& connection, bool was_interrupted) {
      is_again = is_again || was_interrupted;
      return connection.run(
          "SELECT verdict, id, record, accepted FROM finish_run($1::text, $2::bigint, $3::uuid, "
          "$4::boolean, $5::boolean, $6::int, $7::text, $8::text, $9::text[], $10::bigint[], "
          "$11::bigint, $12::int, $13::boolean, $14::text[], $15::text[])",
          id, fence, database_.node(), is_again, ending.ends_others, ending.state, ending.record,
          ending.cancelled, blobs.keys, blobs.bytes, microseconds(ending.delay), ending.waiting_for,
          ending.counts, alike, records);
    });
    rows.next();
    const auto verdict = static_cast<Verdict>(rows.integer(0));
    if (verdict == kLost) return false;
    if (verdict == kDone) break;
    alike.clear();
    records.clear();
    const std::int64_t now = database_.now_us();
    do {
      Job other = job_from_record(rows.text(2));
      const std::int64_t accepted = rows.integer(3);
      other.reused = true;
      other.timing = {};
      other.timing.queue = milliseconds_between(accepted, now);
      give_mesh(other, *ending.mesh);
      end(other, JobState::kSucceeded, accepted, now);
      alike.push_back(rows.text(1));
      records.push_back(to_json(other));
    } while (rows.next());
  }
  forget_run(id, fence);
  // Without a mesh it may be due again, or one like it now. With one, nothing has become ready.
  if (ending.mesh == nullptr) {
    wake_workers();
  } else {
    messages_.tell({.has_work = false, .has_events = true, .cancelled = {}});
  }
  return true;
}

Job PostgresJobStore::cancel(const Viewer& viewer, const std::string& id) {
  const Row row = found(viewer, id);
  if (is_final(row.job.state)) return row.job;
  const Job ended = cancelled(row.job, row.accepted);
  Rows answer = database_.run("SELECT cancel_job($1::text, $2::text, $3::uuid)", id, to_json(ended),
                              database_.node());
  answer.next();
  if (answer.is_null(0)) return get(viewer, id);  // gone meanwhile
  const auto state = static_cast<JobState>(answer.integer(0));
  if (state == JobState::kCancelled) wake_workers();
  if (state == JobState::kRunning) {
    messages_.tell({.has_work = false, .has_events = false, .cancelled = {id}});
    const Lock lock(live_mutex_);
    const auto run = live_.find(id);
    if (run != live_.end()) run->second.lease_until = {};
  }
  return get(viewer, id);
}

Job PostgresJobStore::cancelled(Job job, std::int64_t accepted) const {
  end(job, JobState::kCancelled, accepted, database_.now_us());
  return job;
}

PostgresJobStore::Live* PostgresJobStore::live(const Lease& lease) {
  const auto run = live_.find(lease.id);
  return run != live_.end() && run->second.fence == lease.fence ? &run->second : nullptr;
}

std::optional<PostgresJobStore::Live> PostgresJobStore::live_run(const Lease& lease) const {
  const Lock lock(live_mutex_);
  const auto run = live_.find(lease.id);
  if (run == live_.end() || run->second.fence != lease.fence) return std::nullopt;
  return run->second;
}

void PostgresJobStore::tell(const Lease& lease, const Progress& progress) {
  const auto now = EventFeed::Clock::now();
  bool is_other_stage = false;
  std::int64_t transaction = 0;
  {
    const Lock lock(live_mutex_);
    Live* const run = live(lease);
    if (run == nullptr) return;
    const Progress before = run->progress.value_or(Progress{});
    is_other_stage = before.stage != progress.stage;
    const bool is_further = before.share != progress.share;
    run->progress = progress;
    if (!is_other_stage && (!is_further || now < run->told + kBetweenProgressEvents)) return;
    run->told = now;
    transaction = run->transaction;
  }
  feed_.tell({.id = 0,
              .owner = lease.owner,
              .job = lease.id,
              .kind = is_other_stage ? EventKind::kStage : EventKind::kProgress,
              .state = JobState::kRunning,
              .stage = progress.stage,
              .progress = progress.share},
             transaction);
}

// A later run of the job stays known.
void PostgresJobStore::forget_run(const std::string& id, std::uint64_t fence) {
  const Lock lock(live_mutex_);
  const auto run = live_.find(id);
  if (run != live_.end() && run->second.fence == fence) live_.erase(run);
}

}  // namespace isomesh::store::postgresql
