#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "base/mutex.h"
#include "server/store/blob_store.h"
#include "server/store/job_store.h"
#include "server/store/sqlite/database.h"
#include "server/store/sqlite/event_log.h"

namespace isomesh::store {

// Jobs in the database of a data folder. Leases count the time that passes, whatever
// the system's clock is set to; who holds which is known to this process alone. What changes wakes
// those who wait in this process only; the data folder has one process at a time.
class SqliteJobStore : public JobStore {
 public:
  // Both must outlive it. `blobs` is asked whether a mesh that is to be reused is still there.
  SqliteJobStore(Database& database, const BlobStore& blobs, JobStoreOptions options);

  Submission submit(const JobSpec& spec) override;
  Job remake(const std::string& id) override;
  std::optional<Lease> claim(const std::string& worker, std::chrono::milliseconds lease) override;
  bool wait_for_work(const std::stop_token& stop, std::chrono::milliseconds longest) override;
  Standing renew(const Lease& lease, const Progress& progress,
                 std::chrono::milliseconds length) override;
  bool finish(const Lease& lease, const Outcome& outcome) override;
  bool put_back(const Lease& lease, std::chrono::milliseconds delay,
                std::optional<WaitingFor> waiting_for) override;
  std::size_t reap() override;
  Job cancel(const Viewer& viewer, const std::string& id) override;
  Job get(const Viewer& viewer, const std::string& id) const override;
  JobAccount account(const std::string& id) const override;
  std::vector<Job> list(const Viewer& viewer, std::optional<JobState> state,
                        const std::string& after, std::size_t limit) const override;
  std::vector<Event> events(const Viewer& viewer, const std::string& job, std::uint64_t since,
                            std::chrono::milliseconds timeout) const override;
  std::uint64_t last_event() const override { return log_.end() - 1; }
  bool answers() const override { return true; }
  QueueDepth depth(const Viewer& viewer) const override;
  bool is_full() const override;
  void refuse_new() override;
  void close() override;
  std::vector<Expirable> ended(const ExpiryFilter& filter, Ended which,
                               std::size_t limit) const override;
  Expired expire(std::span<const Expirable> jobs, std::uint64_t enough) override;
  // The data folder has one process, whose turn it always is.
  std::shared_ptr<const void> turn_to_remove() override { return std::make_shared<char>(); }
  std::uint64_t named_bytes() const override;
  OwnedBytes owned_bytes() const override;
  std::optional<Steady> oldest_run() const override;
  void forget_expired(Time before) override;
  void forget_events(Time before) override;

 private:
  struct Row;
  class Change;
  // A run that this process has claimed.
  struct Live {
    std::uint64_t fence = 0;
    Steady claimed;
    Steady lease_until;
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
  // What a job like it has made; empty when that is `spoilt`.
  std::optional<MeshSummary> mesh_like(Connection& connection, const Row& row,
                                       const std::optional<MeshSummary>& spoilt) const;
  // What a job like this one has made, when the bytes of its blobs are damaged; empty otherwise.
  // Reads them.
  std::optional<MeshSummary> spoilt_mesh_for(const JobSpec& spec) const;
  // Empty when its volume is not there.
  std::optional<std::string> result_key_of(Connection& connection, const JobSpec& spec) const;
  void end(Change& change, Row& row, JobState state) const;
  void succeed(Change& change, Row& row, const MeshSummary& mesh) const;
  void succeed_alike(Change& change, const Row& row, const MeshSummary& mesh) const;
  // Queues a job again whose run counts as no attempt, or ends it cancelled.
  void give_back(Change& change, Row& row, std::chrono::milliseconds delay) const;
  void queue_again(Change& change, Row& row, std::chrono::milliseconds delay) const;
  std::vector<Event> kept_events(const Viewer& viewer, const std::string& job, std::uint64_t since,
                                 std::uint64_t end) const;
  Live* live(const Lease& lease) ISOMESH_REQUIRES(live_mutex_);
  bool is_held(const std::string& id, std::uint64_t fence) const;
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

  mutable Mutex live_mutex_;
  std::map<std::string, Live> live_ ISOMESH_GUARDED_BY(live_mutex_);  // of running jobs

  Mutex work_mutex_;
  Condition work_;
  // Grows whenever a job may have become ready.
  std::uint64_t work_generation_ ISOMESH_GUARDED_BY(work_mutex_) = 0;
};

}  // namespace isomesh::store
