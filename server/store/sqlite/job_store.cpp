// Queries about jobs, and their damaged rows; changes of jobs are in job_queue.cpp.
#include "server/store/sqlite/job_store.h"

#include <algorithm>

#include "server/store/damaged_records.h"

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

std::optional<Steady> SqliteJobStore::oldest_run() const {
  const Lock lock(live_mutex_);
  std::optional<Steady> oldest;
  for (const auto& [id, run] : live_) oldest = std::min(oldest.value_or(run.claimed), run.claimed);
  return oldest;
}

void SqliteJobStore::forget_events(Time before) {
  database_.run(store::Change::kRepeatable, "DELETE FROM events WHERE id < ?1", to_us(before));
}

// --- Damaged rows

void SqliteJobStore::leave_out_damaged(const std::string& considered) {
  if (considered.empty()) return leave_out_unreadable();
  if (!can_change(considered)) return leave_out(considered);
  report_damaged_table("records beside those of queued jobs");
}

bool SqliteJobStore::can_change(const std::string& id) {
  try {
    const Transaction transaction(database_.writer(), Durability::kProcess);  // rolled back
    if (!find(transaction.connection(), std::nullopt, id)) return false;
    transaction->run("UPDATE jobs SET state = {job.running} WHERE id = ?", id);
    return true;
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kInternal) throw;
    return false;
  }
}

std::vector<std::string> SqliteJobStore::ids_in(JobState state) const {
  const Reading reading(database_.reader());
  // Indexes have all of this.
  Rows rows = reading->query(state == JobState::kQueued
                                 ? "SELECT id FROM jobs WHERE state = {job.queued}"
                                 : "SELECT id FROM jobs WHERE state = {job.running}");
  std::vector<std::string> ids;
  while (rows.next()) ids.push_back(rows.text(0));
  return ids;
}

bool SqliteJobStore::can_read(const std::string& id) const {
  try {
    const Reading reading(database_.reader());
    return find(reading.connection(), std::nullopt, id).has_value();
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kInternal) throw;
    return false;
  }
}

void SqliteJobStore::leave_out_unreadable() {
  constexpr std::chrono::minutes kBetweenSearches{1};
  {
    const Lock lock(live_mutex_);
    const auto now = Steady::clock::now();
    if (now < next_search_) return;
    next_search_ = now + kBetweenSearches;
  }
  bool has_found = false;
  for (const std::string& id : ids_in(JobState::kQueued)) {
    if (can_read(id)) continue;
    leave_out(id);
    has_found = true;
  }
  if (!has_found) report_damaged_table("records beside those of queued jobs");
}

void SqliteJobStore::leave_out(const std::string& id) {
  report_damaged("job", id);
  const Lock lock(live_mutex_);
  if (unclaimable_.find(id + '\n') == std::string::npos) unclaimable_ += id + '\n';
}

std::string SqliteJobStore::unclaimable() const {
  const Lock lock(live_mutex_);
  return unclaimable_;
}

}  // namespace isomesh::store
