// Changes of jobs, each one call of a database function; queries are in job_store.cpp.
#include <algorithm>

#include "base/ids.h"
#include "proto/json.h"
#include "proto/json_values.h"
#include "server/store/job_rules.h"
#include "server/store/microseconds.h"
#include "server/store/outbox.h"
#include "server/store/postgresql/job_store.h"

namespace isomesh::store {

void visit(Is<Blob> auto& self, auto&& field) {
  field("blob", self.key);
  field("bytes", self.bytes);
}

}  // namespace isomesh::store

namespace isomesh::store::postgresql {

struct PostgresJobStore::Ending {
  // Ends a run of another process; only possible if its lease has expired.
  bool ends_others = false;
  JobState state = JobState::kQueued;
  std::string record = {};     // for jobs that do not run again
  std::string cancelled = {};  // the record to use if the job was cancelled
  const MeshSummary* mesh = nullptr;
  std::chrono::milliseconds delay{0};  // for jobs that run again
  std::optional<WaitingFor> waiting_for = {};
  bool counts = false;  // the attempt counts
};

namespace {

// Interval at which a run writes its progress to the database. This also renews its lease, and
// detects a cancellation whose message was lost.
constexpr std::chrono::milliseconds kBetweenReports{500};
constexpr std::chrono::milliseconds kBetweenRenewals{1000};

// reap() runs every second. A longer gap between its successes means an outage.
constexpr std::chrono::milliseconds kLongestGap{2500};

// Arguments of the database's functions.
class Arguments {
 public:
  template <class T>
  Arguments& put(const char* name, const T& value) {
    json_values::write_field(tree_.root(), name, value);
    return *this;
  }

  std::string text() const { return dump(tree_.root()); }

 private:
  JsonTree tree_;
};

// Another job that ends with a run.
struct Alike {
  std::string id;
  std::string record;
};

void visit(Is<Alike> auto& self, auto&& field) {
  field("id", self.id);
  field("record", self.record);
}

std::vector<Blob> blobs_told(const MeshSummary* mesh) {
  return mesh == nullptr ? std::vector<Blob>() : blobs_of(*mesh);
}

}  // namespace

std::optional<Submission> PostgresJobStore::try_to_submit(const JobSpec& spec, bool may_reuse) {
  const std::int64_t accepted = database_.now_us();
  const Time now = store::from_us(accepted);
  Job job;
  job.id = time_ordered_id(now);
  job.parameters = spec.parameters;
  job.created = timestamp_of(now);
  const Asked found =
      database_.read([&](SqlConnection& connection) { return look_up(connection, spec); })
          .value_or(Asked{});
  const std::string& key = found.result_key;
  const auto made = may_reuse ? made_like(spec.owner, key) : std::nullopt;
  const MeshSummary* mesh = made && made->mesh && !refusing_ ? &*made->mesh : nullptr;
  if (mesh != nullptr) {
    job.reused = true;
    give_mesh(job, *mesh);
    end_job(job, JobState::kSucceeded, accepted, database_.now_us());
  }
  const bool has_room = mesh != nullptr || blobs_.has_room();
  const auto& callback = spec.parameters.callback;
  using Text = std::optional<std::string>;
  Arguments asked;
  asked.put("id", job.id)
      .put("owner", spec.owner)
      .put("priority", static_cast<int>(spec.parameters.priority))
      .put("volume", spec.parameters.volume)
      .put("result_key", key)
      .put("accepted", accepted)
      .put("receiver", callback ? Text(receiver_of(callback->url)) : Text())
      .put("url", callback ? Text(callback->url) : Text())
      .put("idempotency_key", spec.idempotency_key.empty() ? Text() : Text(spec.idempotency_key))
      .put("request_digest", spec.request_digest)
      .put("record", to_record(job))
      .put("cost", found.cost_us)
      .put("version", options_.job_version)
      .put("node", database_.node())
      .put("latest", made ? Text(made->job) : Text())
      .put("reuses", mesh != nullptr)
      .put("runs_anew", !may_reuse)
      .put("blobs", blobs_told(mesh))
      .put("most", refusing_ || !has_room ? 0 : options_.max_queued)
      .put("most_alike", most_queued(spec.parameters.priority))
      .put("is_shared", !spec.owner.empty());
  Rows row = database_.query("SELECT outcome, job FROM submit_job(?1::jsonb)", asked.text());
  row.next();
  const std::string outcome = row.text(0);
  if (outcome == "new") {
    wake_workers();
    return Submission{Submission::Kind::kNew, job};
  }
  if (outcome == "known") {
    return Submission{Submission::Kind::kExisting, get(spec.owner, row.text(1))};
  }
  if (outcome == "conflict") return Submission{Submission::Kind::kConflict, {}};
  if (outcome == "no volume") {
    database_.read([&](SqlConnection& connection) { throw_no_volume_of(connection, spec); });
  }
  if (outcome == "no share") return Submission{Submission::Kind::kOwnersShare, {}};
  if (outcome == "look again") return std::nullopt;
  if (!has_room) {
    throw Error(ErrorCode::kOutOfSpace, "there is not enough disk space for another job");
  }
  return Submission{Submission::Kind::kBusy, {}};
}

std::optional<Lease> PostgresJobStore::claim(const std::string& worker,
                                             std::chrono::milliseconds lease) {
  Steady asked;
  while (const auto claimed = take_next(worker, lease, asked)) {
    if (claimed->is_null(1)) {
      adopt(*claimed);
      continue;
    }
    const auto job = readable_job(claimed->text(4), claimed->text(0));
    if (job) return begin_run(*claimed, *job, asked, lease);
    fail_damaged(claimed->text(0), static_cast<std::uint64_t>(claimed->integer(1)));
  }
  return std::nullopt;
}

std::optional<Rows> PostgresJobStore::take_next(const std::string& worker,
                                                std::chrono::milliseconds lease, Steady& asked) {
  return database_.ask([&](Connection& connection, bool is_again) {
    asked = options_.now();
    std::optional<Rows> rows;
    if (is_again) {
      // A worker has one run at a time, so its current run is what the interrupted claim returned.
      rows = connection.query(
          "SELECT j.id, r.fence, j.attempts, j.owner, j.record, j.accepted, r.claimed, 0 FROM runs "
          "r JOIN jobs j ON j.id = r.job WHERE r.node = ?1::uuid AND r.worker = ?2 AND "
          "r.lease_until > isomesh_now() ORDER BY r.claimed DESC LIMIT 1",
          database_.node(), worker);
      if (rows->next()) return rows;
    }
    rows = connection.query(
        "SELECT id, fence, attempts, owner, record, accepted, claimed, "
        "pg_current_xact_id_if_assigned()::text::bigint FROM claim_job(?1::uuid, ?2, ?3, ?4::int)",
        database_.node(), worker, microseconds(lease), options_.job_version);
    if (!rows->next()) rows.reset();
    return rows;
  });
}

void PostgresJobStore::adopt(const Rows& older) {
  const std::string id = older.text(0);
  std::optional<Asked> asked;
  if (const auto job = readable_job(older.text(4), id)) {
    JobSpec spec;
    spec.owner = older.text(3);
    spec.parameters = job->parameters;
    // A volume with a damaged record fails its own jobs only.
    try {
      asked = database_.read([&](SqlConnection& connection) { return look_up(connection, spec); });
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kInternal || error.fields().empty()) throw;
    }
  }
  const auto key = asked ? std::optional(asked->result_key) : std::nullopt;
  database_.run(Change::kRepeatable,
                "UPDATE jobs SET version = ?2, result_key = coalesce(?3, result_key) WHERE id = ?1 "
                "AND state = {job.queued} AND version < ?2",
                id, options_.job_version, key);
}

// Without this, the job would be claimed again and again.
void PostgresJobStore::fail_damaged(const std::string& id, std::uint64_t fence) {
  const auto row =
      database_.read([&](SqlConnection& connection) { return find(connection, std::nullopt, id); });
  if (!row) return;  // removed meanwhile
  Job job = row->job;
  end_job(job, JobState::kFailed, row->accepted, database_.now_us());
  Ending ending;
  ending.state = JobState::kFailed;
  ending.record = to_record(job);
  ending.cancelled = to_record(cancelled(row->job, row->accepted));
  end_run(id, fence, ending);
}

Lease PostgresJobStore::begin_run(const Rows& claimed, const Job& job, Steady asked,
                                  std::chrono::milliseconds lease) {
  Live run;
  run.job = job;
  run.fence = static_cast<std::uint64_t>(claimed.integer(1));
  run.accepted = claimed.integer(5);
  start_run(run.job, run.accepted, claimed.integer(6));
  run.claimed = asked;
  run.lease_until = asked + lease;
  run.transaction = claimed.integer(7);
  const Lease result = {claimed.text(0), run.fence, static_cast<int>(claimed.integer(2)),
                        claimed.text(3), run.job.parameters};
  {
    const Lock lock(live_mutex_);
    live_[result.id] = std::move(run);
  }
  messages_.tell({.has_work = false, .has_events = true, .cancelled = {}});
  return result;
}

Standing PostgresJobStore::renew(const Lease& lease, const Progress& progress,
                                 std::chrono::milliseconds length) {
  const Steady asked = options_.now();
  bool is_fresh = false;
  {
    const Lock lock(live_mutex_);
    const Live* const run = live(lease.id, lease.fence);
    if (run == nullptr) return Standing::kLost;
    const auto slack = std::min<std::chrono::milliseconds>(
        length / 3, run->recorded == progress.share ? kBetweenRenewals : kBetweenReports);
    const bool is_same_stage = run->progress && run->progress->stage == progress.stage;
    is_fresh = is_same_stage && run->lease_until > asked + length - slack;
  }
  if (!is_fresh) {
    Rows row = database_.query("SELECT renew_run(?1, ?2, ?3, ?4, ?5, ?6)", lease.id, lease.fence,
                               microseconds(length), progress.stage, progress.share,
                               to_json(progress.timing));
    row.next();
    if (row.is_null(0)) {
      forget_run(lease.id, lease.fence);
      return Standing::kLost;
    }
    const Lock lock(live_mutex_);
    Live* const run = live(lease.id, lease.fence);
    if (run == nullptr) return Standing::kLost;
    run->lease_until = asked + length;
    run->recorded = progress.share;
    run->cancelling = run->cancelling || row.boolean(0);
  }
  note(lease, progress);
  const Lock lock(live_mutex_);
  const Live* const run = live(lease.id, lease.fence);
  if (run == nullptr) return Standing::kLost;
  return run->cancelling ? Standing::kCancel : Standing::kOk;
}

bool PostgresJobStore::finish(const Lease& lease, const Outcome& outcome) {
  const auto run = live_run(lease);
  if (!run) return false;
  Job job = run->job;
  if (outcome.mesh) give_timing(job, outcome.timing);
  Ending ending;
  ending.cancelled = to_record(cancelled(job, run->accepted));
  ending.state = state_after(outcome, lease.attempt, options_);
  if (ending.state == JobState::kQueued) {
    ending.delay = delay_after(lease.attempt, options_);
    ending.counts = true;
  } else {
    job.error = outcome.error;
    if (outcome.mesh) give_mesh(job, *(ending.mesh = &*outcome.mesh));
    end_job(job, ending.state, run->accepted, database_.now_us());
    ending.record = to_record(job);
  }
  if (!end_run(lease.id, lease.fence, ending)) return false;
  if (outcome.mesh) {
    for (const Blob& blob : blobs_of(*outcome.mesh)) blobs_.mark_named(blob.key);
  }
  return true;
}

bool PostgresJobStore::put_back(const Lease& lease, std::chrono::milliseconds delay,
                                std::optional<WaitingFor> waiting_for) {
  const auto run = live_run(lease);
  if (!run) return false;
  Ending ending;
  ending.cancelled = to_record(cancelled(run->job, run->accepted));
  ending.delay = delay;
  ending.waiting_for = waiting_for;
  return end_run(lease.id, lease.fence, ending);
}

std::size_t PostgresJobStore::reap() {
  const bool judges_leases = has_responded_for_long();
  Rows rows = database_.query(select_ +
                                  "WHERE (?3 <> 0 AND r.lease_until < isomesh_now()) OR r.node IN "
                                  "(SELECT id FROM nodes WHERE name = ?1 AND id <> ?2::uuid)",
                              database_.node_name(), database_.node(), judges_leases);
  note_response();
  std::size_t reaped = 0;
  while (rows.next()) {
    const Row row = row_of(rows);
    Ending ending;
    ending.ends_others = true;
    ending.cancelled = cancelled_record(row);
    if (end_run(row.job.id, row.fence, ending)) ++reaped;
  }
  return reaped;
}

bool PostgresJobStore::has_responded_for_long() const {
  const Steady now = options_.now();
  const Lock lock(responds_mutex_);
  const bool is_gap = !responded_ || now - *responded_ > kLongestGap;
  return options_.grace.count() == 0 || (!is_gap && now - responds_since_ >= options_.grace);
}

void PostgresJobStore::note_response() {
  const Steady now = options_.now();
  const Lock lock(responds_mutex_);
  if (!responded_ || now - *responded_ > kLongestGap) responds_since_ = now;
  responded_ = now;
}

// Repeats until the records of all equal jobs that end with this run were passed to the database.
bool PostgresJobStore::end_run(const std::string& id, std::uint64_t fence, const Ending& ending) {
  using Number = std::optional<int>;
  Arguments asked;
  asked.put("id", id)
      .put("fence", fence)
      .put("node", database_.node())
      .put("is_again", false)
      .put("ends_others", ending.ends_others)
      .put("state", static_cast<int>(ending.state))
      .put("record", ending.record)
      .put("delay", microseconds(ending.delay))
      .put("waiting_for",
           ending.waiting_for ? Number(static_cast<int>(*ending.waiting_for)) : Number())
      .put("counts", ending.counts)
      .put("cancelled", ending.cancelled)
      .put("blobs", blobs_told(ending.mesh))
      .put("alike", std::vector<Alike>())
      .put("newest", options_.job_version);
  while (true) {
    Rows rows = database_.ask([&](Connection& connection, bool was_interrupted) {
      if (was_interrupted) asked.put("is_again", true);
      return connection.query("SELECT outcome, id, record, accepted FROM finish_run(?1::jsonb)",
                              asked.text());
    });
    rows.next();
    const std::string outcome = rows.text(0);
    if (outcome == "lost") return false;
    if (outcome == "done") break;
    std::vector<Alike> alike;
    const std::int64_t now = database_.now_us();
    do {
      auto readable = readable_job(rows.text(2), rows.text(1));
      if (!readable) {
        cancel(std::nullopt, rows.text(1));
        continue;
      }
      Job other = *std::move(readable);
      skip_run(other, rows.integer(3), now);
      give_mesh(other, *ending.mesh);
      end_job(other, JobState::kSucceeded, rows.integer(3), now);
      alike.push_back({rows.text(1), to_record(other)});
    } while (rows.next());
    asked.put("alike", alike);
  }
  forget_run(id, fence);
  // Without a mesh, this job or an equal one may be ready again. With one, no job becomes ready.
  if (ending.mesh == nullptr) {
    wake_workers();
  } else {
    messages_.tell({.has_work = false, .has_events = true, .cancelled = {}});
  }
  return true;
}

Job PostgresJobStore::cancel(const Viewer& viewer, const std::string& id) {
  const Row row =
      database_.read([&](SqlConnection& connection) { return found(connection, viewer, id); });
  if (row.is_damaged && !row.is_newer && is_final(row.job.state)) {
    return database_.change(Change::kRepeatable, [&](SqlTransaction& transaction) {
      const Job repaired = repair_ended(transaction.connection(), row);
      transaction.commit();
      return repaired;
    });
  }
  if (is_final(row.job.state)) return intact(row).job;
  Rows after = database_.query("SELECT cancel_job(?1, ?2, ?3::uuid)", id, cancelled_record(row),
                               database_.node());
  after.next();
  if (after.is_null(0)) return get(viewer, id);  // removed meanwhile
  const auto state = static_cast<JobState>(after.integer(0));
  if (state == JobState::kCancelled) wake_workers();
  if (state == JobState::kRunning) {
    messages_.tell({.has_work = false, .has_events = false, .cancelled = {id}});
    const Lock lock(live_mutex_);
    const auto run = live_.find(id);
    if (run != live_.end()) run->second.lease_until = {};
  }
  if (row.is_damaged && row.is_newer) {  // its columns tell enough
    Job job = row.job;
    job.state = state;
    job.error.reset();
    return job;
  }
  return get(viewer, id);
}

std::string PostgresJobStore::cancelled_record(const Row& row) const {
  const Job job = cancelled(row.job, row.accepted);
  return row.is_newer ? with_end_of(job, row.record) : to_record(job);
}

Job PostgresJobStore::cancelled(Job job, std::int64_t accepted) const {
  end_job(job, JobState::kCancelled, accepted, database_.now_us());
  return job;
}

std::optional<PostgresJobStore::Live> PostgresJobStore::live_run(const Lease& lease) const {
  const Lock lock(live_mutex_);
  const auto run = live_.find(lease.id);
  if (run == live_.end() || run->second.fence != lease.fence) return std::nullopt;
  Live copy = run->second;
  if (copy.progress) give_progress(copy.job, *copy.progress);
  return copy;
}

}  // namespace isomesh::store::postgresql
