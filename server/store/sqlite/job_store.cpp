// Queries about jobs and events; changes of jobs are in job_queue.cpp.
#include "server/store/sqlite/job_store.h"

#include <algorithm>

#include "proto/json.h"
#include "server/store/job_rules.h"
#include "server/store/sqlite/job_rows.h"

namespace isomesh::store {
namespace {

constexpr std::size_t kMostEvents = 500;

Event event_of(const Rows& row) {
  return {static_cast<std::uint64_t>(row.integer(0)),
          row.text(1),
          row.text(2),
          row.choice(3, EventKind::kDone),
          row.choice(4, JobState::kCancelled),
          row.choice(5, Stage::kDone),
          row.real(6)};
}

std::uint64_t greatest_event(Connection& connection) {
  Rows query = connection.query("SELECT coalesce(max(id), 0) FROM events");
  query.next();
  return static_cast<std::uint64_t>(query.integer(0));
}

}  // namespace

SqliteJobStore::SqliteJobStore(Database& database, BlobStore& blobs, JobStoreOptions options)
    : SqlJobStore(database, blobs, std::move(options),
                  "SELECT j.record, j.owner, j.result_key, j.accepted, j.attempts, j.fence, "
                  "j.cancelling, j.cost, j.id, j.state, j.volume, j.priority FROM jobs j "),
      database_(database),
      log_(greatest_event(database.reader())) {}

SqliteJobStore::Row SqliteJobStore::row_of(const Rows& rows) const {
  Row row = read_row(rows, 8);
  row.cancelling = rows.boolean(6);
  row.cost_us = rows.integer(7);
  return row;
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
  Rows query = reading->query(sql, job, since, end, viewer, kMostEvents);
  std::vector<Event> events;
  while (query.next()) events.push_back(event_of(query));
  return events;
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

std::optional<Steady> SqliteJobStore::oldest_run() const {
  const Lock lock(live_mutex_);
  std::optional<Steady> oldest;
  for (const auto& [id, run] : live_) oldest = std::min(oldest.value_or(run.claimed), run.claimed);
  return oldest;
}

void SqliteJobStore::forget_events(Time before) {
  database_.run(store::Change::kRepeatable, "DELETE FROM events WHERE id < ?1", to_us(before));
}

// --- Meshes shared by several jobs

std::optional<MeshSummary> SqliteJobStore::mesh_like(
    SqlConnection& connection, const std::string& owner, const std::string& result_key,
    const std::optional<MeshSummary>& spoilt) const {
  Rows row = connection.query(
      select_ +
          "WHERE j.owner = ?1 AND j.result_key = ?2 AND j.state = {job.succeeded} ORDER BY j.id "
          "DESC LIMIT 1",
      owner, result_key);
  if (!row.next()) return std::nullopt;
  auto mesh = row_of(row).job.mesh;
  const bool is_spoilt = mesh && spoilt && have_same_blobs(*mesh, *spoilt);
  return mesh && is_there(*mesh, blobs_) && !is_spoilt ? std::move(mesh) : std::nullopt;
}

std::optional<MeshSummary> SqliteJobStore::spoilt_mesh_for(const JobSpec& spec) const {
  auto mesh = database_.read([&](SqlConnection& connection) -> std::optional<MeshSummary> {
    const auto asked = look_up(connection, spec);
    return asked ? mesh_like(connection, spec.owner, asked->result_key, std::nullopt)
                 : std::nullopt;
  });
  return !mesh || is_intact(*mesh, blobs_) ? std::nullopt : std::move(mesh);
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

}  // namespace isomesh::store
