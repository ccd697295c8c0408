#pragma once

#include <atomic>
#include <condition_variable>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "server/store/blob_store.h"
#include "server/store/database.h"
#include "server/store/event_log.h"
#include "server/store/job_store.h"

namespace isomesh::store {

struct JobStoreOptions {
  std::size_t max_queued = 1000;  // a longer queue accepts nothing
  int attempts = 3;               // how often a job is begun that fails or ends its worker
  std::chrono::milliseconds retry_delay{1000};  // after the first attempt; four times it after each
  std::chrono::milliseconds short_run{
      1000};                        // a run that its process did not outlive is charged after it
  std::string mesher_version = {};  // results of another one are not reused
};

// Jobs in the database of a data folder. Leases follow the system's clock. What changes wakes
// those who wait in this process only; the data folder has one process at a time.
class SqliteJobStore : public JobStore {
 public:
  // Both must outlive it. `blobs` is asked whether a mesh that is to be reused is still there.
  SqliteJobStore(Database& database, const BlobStore& blobs, JobStoreOptions options);

  // Ends all leases, for the process that has just taken the data folder's lock: whoever held them
  // is gone. That counts as an attempt of a job that ran alone and had run for a while; of several
  // nobody knows which one it was, and what ends a daemon as soon as it begins is seldom the job,
  // so then none is charged until it was there ten times. Returns how many there were.
  std::size_t reap_all();

  Submission submit(const JobSpec& spec) override;
  std::optional<Lease> claim(const std::string& worker, std::chrono::milliseconds lease) override;
  bool wait_for_work(const std::stop_token& stop, std::chrono::milliseconds longest) override;
  Standing renew(const Lease& lease, const Progress& progress,
                 std::chrono::milliseconds length) override;
  bool finish(const Lease& lease, const Outcome& outcome) override;
  bool put_back(const Lease& lease, std::chrono::milliseconds delay) override;
  std::size_t reap() override;
  Job cancel(const Viewer& viewer, const std::string& id) override;
  Job get(const Viewer& viewer, const std::string& id) const override;
  JobAccount account(const std::string& id) const override;
  Job wait(const Viewer& viewer, const std::string& id,
           std::chrono::milliseconds wait) const override;
  std::vector<Job> list(const Viewer& viewer, std::optional<JobState> state,
                        const std::string& after, std::size_t limit) const override;
  std::vector<Event> events(const Viewer& viewer, const std::string& job, std::uint64_t since,
                            std::chrono::milliseconds timeout) const override;
  QueueDepth depth() const override;
  bool is_full() const override;
  void refuse_new() override;
  void close() override;

 private:
  struct Row;
  class Change;
  // A run that this process has claimed. What the row says counts; this spares renewals a look at
  // it.
  struct Live {
    std::uint64_t fence = 0;
    std::int64_t claimed = 0;
    std::int64_t lease_until = 0;
    bool is_long = false;
    bool cancelling = false;
    std::optional<Progress> progress = {};  // none before the first renewal
    EventLog::Clock::time_point told = {};
  };

  static Row row_of(const Query& query);
  static std::optional<Row> find(Connection& connection, const Viewer& viewer,
                                 const std::string& id);
  // Throws Error kGone or kNotFound for a row that is not there.
  static Row found(Connection& connection, const Viewer& viewer, const std::string& id);
  std::optional<Row> leased(Connection& connection, const Lease& lease) const;
  std::optional<MeshSummary> mesh_like(Connection& connection, const Row& row) const;
  void end(Change& change, Row& row, JobState state) const;
  void succeed(Change& change, Row& row, const MeshSummary& mesh) const;
  void succeed_alike(Change& change, const Row& row, const MeshSummary& mesh) const;
  void queue_again(Change& change, Row& row, std::chrono::milliseconds delay) const;
  std::chrono::milliseconds delay_after(int attempts) const;
  std::vector<Event> kept_events(const Viewer& viewer, const std::string& job, std::uint64_t since,
                                 std::uint64_t end) const;
  Live* live(const Lease& lease);
  void tell(const Lease& lease, const Progress& progress);
  void forget_run(const std::string& id, std::uint64_t fence);
  Job with_progress(const Row& row) const;
  void wake_a_worker();
  void wake_workers();

  Database& database_;
  const BlobStore& blobs_;
  const JobStoreOptions options_;
  mutable EventLog log_;
  std::atomic<bool> refusing_ = false;

  mutable std::mutex live_mutex_;
  std::map<std::string, Live> live_;  // of running jobs; guarded by live_mutex_

  std::mutex work_mutex_;
  std::condition_variable_any work_;
  std::uint64_t work_generation_ = 0;  // guarded by work_mutex_
  std::uint64_t work_seen_ = 0;        // guarded by work_mutex_
};

// The same for all jobs that make the same bytes: of the version and the parameters, but for those
// that only say when a job runs.
std::string result_key(const JobParameters& parameters, const std::string& mesher_version);

}  // namespace isomesh::store
