#pragma once

#include <atomic>
#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/mutex.h"
#include "server/store/blob_store.h"
#include "server/store/job_store.h"
#include "server/store/sql/sql.h"

namespace isomesh::store {

// The part of the job store that is the same for all databases: queries, expiry, and what a
// submission reads. Each engine implements the verbs of the queue as its transactions; job_rules.h
// has what they do to jobs, fair_queue.h whose turn it is. Thread safe.
class SqlJobStore : public JobStore {
 public:
  Submission submit(const JobSpec& spec) override;
  Job remake(const std::string& id) override;
  bool wait_for_work(const std::stop_token& stop, std::chrono::milliseconds longest) override;
  bool erase(const Viewer& viewer, const std::string& id, const BlobsGoing& going) override;
  Job get(const Viewer& viewer, const std::string& id) const override;
  JobAccount account(const std::string& id) const override;
  std::vector<Job> list(const Viewer& viewer, const JobFilter& filter, const std::string& after,
                        std::size_t limit) const override;
  QueueDepth depth(const Viewer& viewer) const override;
  bool is_full() const override;
  void refuse_new() override { refusing_ = true; }
  void close() override;
  std::vector<Expirable> ended(const ExpiryFilter& filter, Ended which,
                               std::size_t limit) const override;
  Expired expire(std::span<const Expirable> jobs, std::uint64_t enough) override;
  std::uint64_t named_bytes() const override;
  OwnedBytes owned_bytes() const override;
  void forget_expired(Time before) override;

 protected:
  struct Row {
    Job job;
    bool is_damaged = false;  // the job is damaged_job()
    bool is_newer = false;    // than this version, which may know only a part of `record`
    std::string record;       // only of newer ones
    std::string owner;
    std::string result_key;
    std::int64_t accepted = 0;
    int attempts = 0;
    std::uint64_t fence = 0;
    bool cancelling = false;
    std::int64_t cost_us = 0;  // see fair_queue.h
  };
  // Properties of a job to be stored.
  struct Asked {
    std::string result_key;
    std::int64_t cost_us = 0;
  };
  // The latest succeeded job with a result key.
  struct Made {
    std::string job;
    std::optional<MeshSummary> mesh;  // empty if its blobs are incomplete or damaged
  };
  // A run claimed by this process.
  struct Live {
    std::uint64_t fence = 0;
    Steady claimed;
    Steady lease_until;  // as far as this process knows
    bool cancelling = false;
    std::optional<Progress> progress = {};  // none before the first renewal
    double recorded = 0;                    // of the progress, at the last renewal that recorded it
    Steady told = {};
    // For engines whose record lacks it: the job as claimed, and the claim's transaction.
    Job job = {};
    std::int64_t accepted = 0;
    std::int64_t transaction = 0;
  };

  // `select` reads the columns that row_of() takes, from `jobs j`. `blobs` tells whether a mesh to
  // be reused still exists. `database` and `blobs` must outlive this object.
  SqlJobStore(SqlDatabase& database, BlobStore& blobs, JobStoreOptions options, std::string select)
      : blobs_(blobs),
        options_(std::move(options)),
        select_(std::move(select)),
        records_(database) {}

  // One attempt; empty if equal jobs changed meanwhile, so that the caller must retry. Without
  // `may_reuse`, it takes no mesh of an equal job, and is never empty.
  virtual std::optional<Submission> try_to_submit(const JobSpec& spec, bool may_reuse) = 0;
  virtual Row row_of(const Rows& rows) const = 0;
  // Time until the first waiting job can be claimed; empty if none waits.
  virtual std::optional<std::chrono::microseconds> until_ready() const = 0;
  // Adds an event that is not stored, after those of the run's transaction.
  virtual void tell(Event event, std::int64_t transaction) = 0;
  virtual void close_events() = 0;

  std::optional<Row> find(SqlConnection& connection, const Viewer& viewer,
                          const std::string& id) const;
  // Throws Error kGone or kNotFound if there is no such row. The row may be damaged.
  Row found(SqlConnection& connection, const Viewer& viewer, const std::string& id) const;
  // Reads the columns `record`, `owner`, `result_key`, `accepted`, `attempts` and `fence`, which
  // come first, and `id`, `state`, `volume` and `priority`, which begin at that number.
  static Row read_row(const Rows& rows, int columns, bool is_newer = false);
  // Throws Error kInternal if the row's record is damaged, and kUnavailable if only a newer version
  // can read it.
  static Row intact(Row row);
  // Cancels a job that has ended and whose record is damaged, so that its record is valid again.
  Job repair_ended(SqlConnection& connection, const Row& row) const;
  // Replaces recorded progress by newer progress of this process's own runs.
  Job with_progress(const Row& row) const;
  // Empty if the volume is missing.
  std::optional<Asked> look_up(SqlConnection& connection, const JobSpec& spec) const;
  // Reads the blobs of the mesh.
  std::optional<Made> made_like(const std::string& owner, const std::string& result_key) const;
  // Throws Error kNotFound, or kGone if the volume has expired.
  [[noreturn]] static void throw_no_volume_of(SqlConnection& connection, const JobSpec& spec);
  bool is_full(SqlConnection& connection) const;
  // The part of the queue that jobs of that priority may fill, and of which each owner has a share
  // (base/share.h).
  std::size_t most_queued(Priority priority) const;
  // Empty if that part has room for another job of the owner. Otherwise kOwnersShare, or kBusy if
  // the owner has no job there.
  std::optional<Submission::Kind> find_no_room(SqlConnection& connection,
                                               const JobSpec& spec) const;

  // Null if this process has no such run.
  Live* live(const std::string& id, std::uint64_t fence) ISOMESH_REQUIRES(live_mutex_);
  // Emits an event if the progress is new.
  void note(const Lease& lease, const Progress& progress);
  // Removes the run, unless the job has a later run.
  void forget_run(const std::string& id, std::uint64_t fence);

  // For one job that has become ready; wake_all_workers() for more.
  void wake_a_worker();
  void wake_all_workers();

  BlobStore& blobs_;
  const JobStoreOptions options_;
  const std::string select_;
  std::atomic<bool> refusing_ = false;

  mutable Mutex live_mutex_;
  std::map<std::string, Live> live_ ISOMESH_GUARDED_BY(live_mutex_);  // of running jobs

 private:
  std::vector<Job> list_after(const Viewer& viewer, const JobFilter& filter,
                              const std::string& after, std::size_t limit) const;
  // The same from a table with damaged pages.
  std::vector<Job> undamaged_after(const Viewer& viewer, const JobFilter& filter,
                                   const std::string& after, std::size_t limit) const;
  // True if the job failed because of a damaged volume that is intact now.
  bool is_repaired(const Job& job) const;

  SqlDatabase& records_;

  Mutex work_mutex_;
  Condition work_;
  // Increments whenever a job may have become ready.
  std::uint64_t work_generation_ ISOMESH_GUARDED_BY(work_mutex_) = 0;
};

inline std::int64_t microseconds(std::chrono::milliseconds time) {
  return std::chrono::microseconds(time).count();
}

}  // namespace isomesh::store
