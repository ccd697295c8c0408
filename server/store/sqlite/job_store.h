#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/store/sql/job_store.h"
#include "server/store/sqlite/database.h"
#include "server/store/sqlite/event_log.h"

namespace isomesh::store {

// Jobs in the database of a data folder. Leases use the steady clock, so setting the system's clock
// does not affect them. Only this process knows who holds a lease, and changes wake only waiters in
// this process; a data folder has one process at a time.
class SqliteJobStore : public SqlJobStore {
 public:
  // `database` and `blobs` must outlive this object.
  SqliteJobStore(Database& database, BlobStore& blobs, JobStoreOptions options);

  std::optional<Lease> claim(const std::string& worker, std::chrono::milliseconds lease) override;
  Standing renew(const Lease& lease, const Progress& progress,
                 std::chrono::milliseconds length) override;
  bool finish(const Lease& lease, const Outcome& outcome) override;
  bool put_back(const Lease& lease, std::chrono::milliseconds delay,
                std::optional<WaitingFor> waiting_for) override;
  std::size_t reap() override;
  Job cancel(const Viewer& viewer, const std::string& id) override;
  std::vector<Event> events(const Viewer& viewer, const std::string& job, std::uint64_t since,
                            std::chrono::milliseconds timeout) const override {
    return log_.events(viewer, job, since, timeout);
  }
  std::uint64_t last_event() const override { return log_.last(); }
  bool responds() const override { return true; }
  // Always granted, because a data folder has one process only.
  std::shared_ptr<const void> claim_removal() override { return std::make_shared<char>(); }
  std::optional<Steady> oldest_run() const override;
  void forget_events(Time before) override;

 private:
  class Change;

  std::optional<Submission> try_to_submit(const JobSpec& spec, bool may_reuse) override;
  Row row_of(const Rows& rows) const override;
  std::optional<std::chrono::microseconds> until_ready() const override;
  void tell(Event event, std::int64_t) override { log_.tell(std::move(event)); }
  void close_events() override { log_.close(); }

  // Selects the next job to run and charges its owner's turn.
  std::optional<Row> take_next(Change& change, std::int64_t now, std::string& considered);
  // As claim(). `considered` becomes the job that was selected last.
  std::optional<Lease> claim_next(const std::string& worker, std::chrono::milliseconds lease,
                                  std::string& considered);
  // Never selects that job again, because its rows in the database are damaged.
  void leave_out(const std::string& id);
  // The same for all queued jobs that cannot be read. Searches once a minute at most.
  void leave_out_unreadable();
  // After an error of the database while that job was to be claimed, or none if empty: leaves out
  // what is to blame.
  void leave_out_damaged(const std::string& considered);
  // True if the job alone can be read and changed. Changes nothing.
  bool can_change(const std::string& id);
  bool can_read(const std::string& id) const;
  // As reap(), for one job; false if it is not lost.
  bool reap(const std::string& id);
  // Ids of all jobs that are queued or running.
  std::vector<std::string> ids_in(JobState state) const;
  std::string unclaimable() const;
  // Its mesh may be used: the blobs are kept as long as the row.
  static bool has_succeeded(Connection& connection, const std::string& id);
  // The id of the latest succeeded job with the row's owner and result key; empty if there is none.
  static std::string latest_like(Connection& connection, const Row& row);
  // The run's job with its last progress. Empty if the lease is lost.
  std::optional<Row> leased(Connection& connection, const Lease& lease) const;
  // The job submitted before with the same key.
  std::optional<Submission> known(Connection& connection, const JobSpec& spec) const;
  void end(Change& change, Row& row, JobState state);
  void succeed(Change& change, Row& row, const MeshSummary& mesh);
  void succeed_alike(Change& change, const Row& row, const MeshSummary& mesh);
  // Queues a job again without counting the attempt, or ends it as cancelled.
  void give_back(Change& change, Row& row, std::chrono::milliseconds delay);
  void queue_again(Change& change, Row& row, std::chrono::milliseconds delay);
  // True if this process has an unexpired lease of the job, of any run if `fence` is empty.
  bool is_held(const std::string& id, std::optional<std::uint64_t> fence = {}) const;

  Database& database_;
  EventLog log_;
  // Ids of jobs that were left out, each with a line break.
  std::string unclaimable_ ISOMESH_GUARDED_BY(live_mutex_);
  Steady next_search_ ISOMESH_GUARDED_BY(live_mutex_) = {};  // for jobs that cannot be read
};

}  // namespace isomesh::store
