// Queries about jobs; changes of jobs are in job_queue.cpp.
#include "server/store/sqlite/job_store.h"

#include <algorithm>

#include "proto/json.h"
#include "server/store/job_rules.h"
#include "server/store/sqlite/job_rows.h"

namespace isomesh::store {

SqliteJobStore::SqliteJobStore(Database& database, BlobStore& blobs, JobStoreOptions options)
    : SqlJobStore(database, blobs, std::move(options),
                  "SELECT j.record, j.owner, j.result_key, j.accepted, j.attempts, j.fence, "
                  "j.cancelling, j.cost, j.id, j.state, j.volume, j.priority FROM jobs j "),
      database_(database),
      log_(database) {}

SqliteJobStore::Row SqliteJobStore::row_of(const Rows& rows) const {
  Row row = read_row(rows, 8);
  row.cancelling = rows.boolean(6);
  row.cost_us = rows.integer(7);
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

std::optional<Steady> SqliteJobStore::oldest_run() const {
  const Lock lock(live_mutex_);
  std::optional<Steady> oldest;
  for (const auto& [id, run] : live_) oldest = std::min(oldest.value_or(run.claimed), run.claimed);
  return oldest;
}

void SqliteJobStore::forget_events(Time before) {
  database_.run(store::Change::kRepeatable, "DELETE FROM events WHERE id < ?1", to_us(before));
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
