// Changes of jobs, one transaction per function; queries are in job_store.cpp.
#include <algorithm>

#include "base/clock.h"
#include "base/ids.h"
#include "proto/json.h"
#include "server/store/damaged_records.h"
#include "server/store/job_rules.h"
#include "server/store/sql/outbox.h"
#include "server/store/sqlite/job_store.h"

namespace isomesh::store {
namespace {

// The longest possible delay of a job. A longer one means that the clock was set back.
constexpr std::int64_t kLongestWaitUs = std::int64_t{3600} * 1'000'000;

}  // namespace

// One transaction and its events, which become visible when it ends.
class SqliteJobStore::Change {
 public:
  Change(SqliteJobStore& store, Durability durability = Durability::kFull)
      : log_(store.log_), transaction_(store.database_.writer(), durability) {}
  // The transaction's lock is still held, so its events are the last ones.
  ~Change() {
    if (announced_ > 0 && transaction_.is_open()) log_.withdraw(announced_);
  }
  Change(const Change&) = delete;
  Change& operator=(const Change&) = delete;

  Connection* operator->() const { return &transaction_.connection(); }
  Connection& connection() const { return transaction_.connection(); }

  // Stores an event with the row's present state.
  void announce(const Row& row, EventKind kind);

  void commit() {
    if (announced_ > 0) {
      transaction_.at_end([&log = log_](bool is_committed) { log.end_transaction(is_committed); });
    }
    transaction_.commit();
  }

 private:
  EventLog& log_;
  std::size_t announced_ = 0;
  Transaction transaction_;  // last: its lock is held until the events are withdrawn
};

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

std::optional<Submission> SqliteJobStore::known(Connection& connection, const JobSpec& spec) const {
  if (spec.idempotency_key.empty()) return std::nullopt;
  std::string id;
  {
    Rows earlier = connection.query(
        "SELECT id, request_digest FROM jobs WHERE owner = ?1 AND idempotency_key = ?2", spec.owner,
        spec.idempotency_key);
    if (!earlier.next()) return std::nullopt;
    if (earlier.text(1) != spec.request_digest) {
      return Submission{Submission::Kind::kConflict, {}};
    }
    id = earlier.text(0);
  }
  return Submission{Submission::Kind::kExisting,
                    with_progress(found(connection, std::nullopt, id))};
}

std::optional<Submission> SqliteJobStore::try_to_submit(const JobSpec& spec, bool may_reuse) {
  // Blobs are read before the transaction, because others wait for the transaction.
  const auto before =
      database_.read([&](SqlConnection& connection) { return look_up(connection, spec); });
  const auto made = before && may_reuse ? made_like(spec.owner, before->result_key) : std::nullopt;
  Row row;
  row.owner = spec.owner;
  {
    Change change(*this);
    if (auto earlier = known(change.connection(), spec)) return *std::move(earlier);
    const auto asked = look_up(change.connection(), spec);
    if (!asked) throw_no_volume_of(change.connection(), spec);
    const bool has_same_notes = before && before->result_key == asked->result_key;
    if (may_reuse && !has_same_notes) return std::nullopt;
    row.result_key = asked->result_key;
    row.cost_us = asked->cost_us;
    row.accepted = now_us();
    row.job.id = time_ordered_id(from_us(row.accepted));
    row.job.parameters = spec.parameters;
    row.job.created = timestamp_of(from_us(row.accepted));
    const auto mesh = made ? made->mesh : std::nullopt;
    const bool is_current = mesh ? has_succeeded(change.connection(), made->job)
                                 : latest_like(change.connection(), row) == (made ? made->job : "");
    if (may_reuse && !is_current) return std::nullopt;
    if (refusing_ || (!mesh && is_full(change.connection()))) {
      return Submission{Submission::Kind::kBusy, {}};
    }
    const auto no_room = mesh ? std::nullopt : find_no_room(change.connection(), spec);
    if (no_room) return Submission{*no_room, {}};
    if (!mesh && !blobs_.has_room()) {
      throw Error(ErrorCode::kOutOfSpace, "there is not enough disk space for another job");
    }
    const std::optional<std::string> key =
        spec.idempotency_key.empty() ? std::nullopt : std::optional(spec.idempotency_key);
    change->run(
        "INSERT INTO jobs(id, owner, state, priority, volume, result_key, accepted, not_before, "
        "attempts, fence, cancelling, idempotency_key, request_digest, record, cost) "
        "VALUES(?, ?, {job.queued}, ?, ?, ?, ?, 0, 0, 0, 0, ?, ?, ?, ?)",
        row.job.id, row.owner, spec.parameters.priority, spec.parameters.volume, row.result_key,
        row.accepted, key, spec.request_digest, to_record(row.job), row.cost_us);
    if (mesh) {
      row.job.reused = true;
      succeed(change, row, *mesh);
    } else {
      change.announce(row, EventKind::kStage);
    }
    change.commit();
  }
  if (!is_final(row.job.state)) wake_a_worker();
  return Submission{Submission::Kind::kNew, row.job};
}

bool SqliteJobStore::has_succeeded(Connection& connection, const std::string& id) {
  return connection.query("SELECT 1 FROM jobs WHERE id = ?1 AND state = {job.succeeded}", id)
      .next();
}

std::string SqliteJobStore::latest_like(Connection& connection, const Row& row) {
  Rows latest = connection.query(
      "SELECT max(id) FROM jobs WHERE owner = ?1 AND result_key = ?2 AND state = {job.succeeded}",
      row.owner, row.result_key);
  latest.next();
  return latest.is_null(0) ? "" : latest.text(0);
}

std::optional<Lease> SqliteJobStore::claim(const std::string& worker,
                                           std::chrono::milliseconds lease) {
  std::string considered;
  try {
    return claim_next(worker, lease, considered);
  } catch (const Error& error) {
    // SQLite writes nothing more in this transaction. The next one leaves the job out.
    if (is_of_damaged_database(error)) leave_out_damaged(considered);
    throw;
  }
}

std::optional<Lease> SqliteJobStore::claim_next(const std::string& worker,
                                                std::chrono::milliseconds lease,
                                                std::string& considered) {
  // If a power failure reverts a claim, the job is queued again and its worker is gone anyway.
  Change change(*this, Durability::kProcess);
  const std::int64_t now = now_us();
  auto next = take_next(change, now, considered);
  while (next && next->is_damaged) {
    end(change, *next, JobState::kFailed);
    next = take_next(change, now, considered);
  }
  if (!next) {
    change.commit();
    return std::nullopt;
  }
  Row& row = *next;
  row.fence += 1;
  row.attempts += 1;
  start_run(row.job, row.accepted, now);
  change->run(
      "UPDATE jobs SET state = {job.running}, attempts = ?, fence = ?, claimed = ?, worker = ?, "
      "waiting_for = NULL, record = ? WHERE id = ?",
      row.attempts, row.fence, now, worker, to_record(row.job), row.job.id);
  change.announce(row, EventKind::kStage);
  {
    // Before any other transaction, which may cancel the run or end its lease.
    const Lock lock(live_mutex_);
    const Steady began = Steady::clock::now();
    live_[row.job.id] = {.fence = row.fence, .claimed = began, .lease_until = began + lease};
  }
  try {
    change.commit();
  } catch (...) {
    forget_run(row.job.id, row.fence);
    throw;
  }
  return Lease{row.job.id, row.fence, row.attempts, row.owner, row.job.parameters};
}

std::optional<SqliteJobStore::Row> SqliteJobStore::take_next(Change& change, std::int64_t now,
                                                             std::string& considered) {
  std::optional<Row> row;
  std::int64_t start_tag = 0;
  do {
    const std::string left_out = unclaimable();
    considered.clear();
    Rows query = change->query(
        std::string(
            "WITH heads AS MATERIALIZED (SELECT q.priority, q.start_tag, (SELECT j.id FROM jobs j "
            "WHERE j.state = {job.queued} AND j.priority = q.priority AND j.owner = q.owner AND "
            "j.not_before NOT BETWEEN ?1 + 1 AND ?1 + ?2 AND NOT EXISTS (SELECT 1 FROM jobs r "
            "WHERE r.owner = j.owner "
            "AND r.result_key = j.result_key AND r.state = {job.running}) ") +
            // A separate text, because the usual one is called often.
            (left_out.empty() ? "AND ?3 = '' " : "AND instr(?3, j.id || char(10)) = 0 ") +
            "ORDER BY j.id LIMIT 1) AS job FROM queued_owners q) SELECT job, start_tag FROM heads "
            "WHERE job IS NOT NULL ORDER BY priority, start_tag, job LIMIT 1",
        now, kLongestWaitUs, left_out);
    if (!query.next()) break;
    considered = query.text(0);
    start_tag = query.integer(1);
    row = find(change.connection(), std::nullopt, considered);
    if (!row) leave_out(considered);  // the index is damaged
  } while (!row);
  // No job of a higher priority is ready, or none at all.
  constexpr int kAfterAll = static_cast<int>(Priority::kBulk) + 1;
  const int priority = row ? static_cast<int>(row->job.parameters.priority) : kAfterAll;
  change->run("DELETE FROM turns WHERE (priority, finish_tag) <= (?, ?)", priority, start_tag);
  if (!row) return row;
  change->run("INSERT OR REPLACE INTO turns VALUES(?, ?, ?, ?)", priority, row->owner, start_tag,
              start_tag + row->cost_us);
  return row;
}

std::optional<std::chrono::microseconds> SqliteJobStore::until_ready() const {
  constexpr std::chrono::seconds kLook{1};
  const std::string left_out = unclaimable();
  try {
    const Reading reading(database_.reader());
    Rows row = reading->query(
        std::string(
            "SELECT min(not_before) - isomesh_now() FROM jobs q WHERE state = {job.queued} AND NOT "
            "EXISTS (SELECT 1 "
            "FROM jobs r WHERE r.owner = q.owner AND r.result_key = q.result_key AND r.state = "
            "{job.running})") +
            (left_out.empty() ? " AND ?1 = ''" : " AND instr(?1, q.id || char(10)) = 0"),
        left_out);
    row.next();
    if (row.is_null(0)) return std::nullopt;
    return std::chrono::microseconds(row.integer(0) > kLongestWaitUs ? 0 : row.integer(0));
  } catch (const Error& error) {
    // A row is damaged; claim() reports it and finds the others.
    if (error.code() != ErrorCode::kInternal) throw;
    return kLook;
  }
}

Standing SqliteJobStore::renew(const Lease& lease, const Progress& progress,
                               std::chrono::milliseconds length) {
  if (!is_held(lease.id, lease.fence)) return Standing::kLost;
  note(lease, progress);
  const Lock lock(live_mutex_);
  Live* const renewed = live(lease.id, lease.fence);
  // Once more, because this process may have been stopped for long since the first look.
  const auto now = Steady::clock::now();
  if (renewed == nullptr || renewed->lease_until < now) return Standing::kLost;
  renewed->lease_until = now + length;
  return renewed->cancelling ? Standing::kCancel : Standing::kOk;
}

bool SqliteJobStore::finish(const Lease& lease, const Outcome& outcome) {
  bool has_mesh = false;
  const bool is_held = database_.freeing([&] {
    Change change(*this);
    auto held = leased(change.connection(), lease);
    if (!held) return false;
    Row& row = *held;
    if (outcome.mesh) give_timing(row.job, outcome.timing);
    const JobState state =
        row.cancelling ? JobState::kCancelled : state_after(outcome, row.attempts, options_);
    has_mesh = state == JobState::kSucceeded;
    if (has_mesh) {
      succeed(change, row, *outcome.mesh);
      succeed_alike(change, row, *outcome.mesh);
    } else if (state == JobState::kQueued) {
      queue_again(change, row, delay_after(row.attempts, options_));
    } else {
      row.job.error = outcome.error;
      end(change, row, state);
    }
    change.commit();
    return true;
  });
  if (!is_held) return false;
  forget_run(lease.id, lease.fence);
  if (has_mesh) {
    for (const Blob& blob : blobs_of(*outcome.mesh)) blobs_.mark_named(blob.key);
  }
  // Without a mesh, this job or an equal one may be ready again. With one, no job becomes ready.
  if (!has_mesh) wake_all_workers();
  return true;
}

bool SqliteJobStore::put_back(const Lease& lease, std::chrono::milliseconds delay,
                              std::optional<WaitingFor> waiting_for) {
  const bool is_held = database_.freeing([&] {
    Change change(*this);
    auto held = leased(change.connection(), lease);
    if (!held) return false;
    held->job.waiting_for = waiting_for;
    give_back(change, *held, delay);
    change.commit();
    return true;
  });
  if (!is_held) return false;
  forget_run(lease.id, lease.fence);
  wake_all_workers();
  return true;
}

std::size_t SqliteJobStore::reap() {
  std::size_t reaped = 0;
  for (const std::string& id : ids_in(JobState::kRunning)) {
    try {
      if (!reap(id)) continue;
      ++reaped;
      wake_all_workers();
    } catch (const Error& error) {
      // A job that is damaged itself stops no other.
      if (!is_of_damaged_database(error) || can_change(id)) throw;
      report_damaged("job", id);
    }
  }
  return reaped;
}

bool SqliteJobStore::reap(const std::string& id) {
  if (is_held(id)) return false;  // usual, and needs no transaction
  return database_.freeing([&] {
    Change change(*this);
    auto row = find(change.connection(), std::nullopt, id);
    if (!row || row->job.state != JobState::kRunning || is_held(id)) return false;
    row->job = with_progress(*row);
    give_back(change, *row, std::chrono::milliseconds(0));
    change.commit();
    forget_run(id, row->fence);
    return true;
  });
}

Job SqliteJobStore::cancel(const Viewer& viewer, const std::string& id) {
  return database_.freeing([&] {
    Change change(*this);
    Row row = found(change.connection(), viewer, id);
    if (row.is_damaged && is_final(row.job.state)) {
      row.job = repair_ended(change.connection(), row);
    } else if (row.job.state == JobState::kQueued) {
      end(change, row, JobState::kCancelled);
    } else if (row.job.state == JobState::kRunning) {
      change->run("UPDATE jobs SET cancelling = 1 WHERE id = ?", id);
    }
    change.commit();
    if (row.job.state == JobState::kRunning) {
      const Lock lock(live_mutex_);
      const auto run = live_.find(id);
      if (run != live_.end() && run->second.fence == row.fence) run->second.cancelling = true;
    }
    return with_progress(row);
  });
}

std::optional<SqliteJobStore::Row> SqliteJobStore::leased(Connection& connection,
                                                          const Lease& lease) const {
  auto row = find(connection, std::nullopt, lease.id);
  const bool is_its = row && row->job.state == JobState::kRunning && row->fence == lease.fence;
  if (!is_its || !is_held(lease.id, lease.fence)) return std::nullopt;
  row->job = with_progress(*row);
  return row;
}

bool SqliteJobStore::is_held(const std::string& id, std::optional<std::uint64_t> fence) const {
  const Lock lock(live_mutex_);
  const auto run = live_.find(id);
  return run != live_.end() && run->second.fence == fence.value_or(run->second.fence) &&
         run->second.lease_until >= Steady::clock::now();
}

void SqliteJobStore::end(Change& change, Row& row, JobState state) {
  const std::int64_t now = now_us();
  end_job(row.job, state, row.accepted, now);
  change->run("UPDATE jobs SET state = ?, finished = isomesh_kept(?), record = ? WHERE id = ?",
              state, now, to_record(row.job), row.job.id);
  change->run("UPDATE volumes SET used = max(used, isomesh_kept(?)) WHERE owner = ? AND id = ?",
              now, row.owner, row.job.parameters.volume);
  if (const auto& callback = row.job.parameters.callback) {
    add_callback(change.connection(), row.job.id, callback->url, to_json(row.job));
  }
  change.announce(row, EventKind::kDone);
}

void SqliteJobStore::succeed(Change& change, Row& row, const MeshSummary& mesh) {
  if (row.is_damaged) return end(change, row, JobState::kFailed);
  give_mesh(row.job, mesh);
  for (const Blob& blob : blobs_of(mesh)) {
    change->run("INSERT OR IGNORE INTO meshes VALUES(?, ?, ?)", row.job.id, blob.key, blob.bytes);
  }
  end(change, row, JobState::kSucceeded);
}

void SqliteJobStore::succeed_alike(Change& change, const Row& row, const MeshSummary& mesh) {
  std::vector<Row> alike;
  {
    Rows query = change->query(
        select_ + "WHERE j.owner = ?1 AND j.result_key = ?2 AND j.state = {job.queued}", row.owner,
        row.result_key);
    while (query.next()) alike.push_back(row_of(query));
  }
  for (Row& other : alike) {
    skip_run(other.job, other.accepted, now_us());
    succeed(change, other, mesh);
  }
}

void SqliteJobStore::give_back(Change& change, Row& row, std::chrono::milliseconds delay) {
  if (row.cancelling) return end(change, row, JobState::kCancelled);
  row.attempts -= 1;
  queue_again(change, row, delay);
}

void SqliteJobStore::queue_again(Change& change, Row& row, std::chrono::milliseconds delay) {
  if (row.is_damaged) return end(change, row, JobState::kFailed);
  row.job.state = JobState::kQueued;
  row.job.stage = Stage::kQueue;
  row.job.progress = 0;
  row.job.started.reset();
  row.job.timing = {};
  change->run(
      "UPDATE jobs SET state = {job.queued}, attempts = ?, not_before = ?, waiting_for = ?, record "
      "= ? WHERE id = ?",
      row.attempts, now_us() + microseconds(delay), row.job.waiting_for, to_record(row.job),
      row.job.id);
  change.announce(row, EventKind::kStage);
}

}  // namespace isomesh::store
