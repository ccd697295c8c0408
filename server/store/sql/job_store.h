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

// What is the same of jobs in whatever database: what can be asked about them and what removes
// them. How they are queued and run is each engine's own. Thread safe.
class SqlJobStore : public JobStore {
 public:
  Job remake(const std::string& id) override;
  bool wait_for_work(const std::stop_token& stop, std::chrono::milliseconds longest) override;
  Job get(const Viewer& viewer, const std::string& id) const override;
  JobAccount account(const std::string& id) const override;
  std::vector<Job> list(const Viewer& viewer, std::optional<JobState> state,
                        const std::string& after, std::size_t limit) const override;
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
    std::string owner;
    std::string result_key;
    std::int64_t accepted = 0;
    int attempts = 0;
    std::uint64_t fence = 0;
    bool cancelling = false;
    std::int64_t cost_us = 0;  // see turns.h
  };
  // What is known of a job that is to be stored.
  struct Asked {
    std::string result_key;
    std::int64_t cost_us = 0;
  };
  // A run that this process has claimed.
  struct Live {
    std::uint64_t fence = 0;
    Steady claimed;
    Steady lease_until;  // as far as this process knows
    bool cancelling = false;
    std::optional<Progress> progress = {};  // none before the first renewal
    double recorded = 0;                    // the share of it that the last renewal recorded
    Steady told = {};
    // Where a record does not say it: the job as it was claimed, and by which transaction.
    Job job = {};
    std::int64_t accepted = 0;
    std::int64_t transaction = 0;
  };

  // Both must outlive it. `select` reads what row_of() takes, from `jobs j`; `blobs` is asked
  // whether a mesh that is to be reused is still there.
  SqlJobStore(SqlDatabase& database, const BlobStore& blobs, JobStoreOptions options,
              std::string select)
      : blobs_(blobs),
        options_(std::move(options)),
        select_(std::move(select)),
        records_(database) {}

  virtual Row row_of(const Rows& rows) const = 0;
  // Until the first of the jobs may be claimed that wait; empty when there is none.
  virtual std::optional<std::chrono::microseconds> until_ready() const = 0;
  // Has an event seen that is not kept, after those of the run's transaction.
  virtual void tell(Event event, std::int64_t transaction) = 0;
  virtual void close_events() = 0;

  std::optional<Row> find(SqlConnection& connection, const Viewer& viewer,
                          const std::string& id) const;
  // Throws Error kGone or kNotFound for a row that is not there.
  Row found(SqlConnection& connection, const Viewer& viewer, const std::string& id) const;
  // What this process knows of its own runs is newer than what is recorded.
  Job with_progress(const Row& row) const;
  // Empty when its volume is not there.
  std::optional<Asked> look_up(SqlConnection& connection, const JobSpec& spec) const;
  // Throws that it is not, or not any more.
  [[noreturn]] static void throw_no_volume_of(SqlConnection& connection, const JobSpec& spec);
  bool is_full(SqlConnection& connection) const;
  // Whether the queue has room for one more of its owner.
  bool has_share(SqlConnection& connection, const JobSpec& spec) const;

  // Null when the process has no such run; to be called with the lock.
  Live* live(const std::string& id, std::uint64_t fence) ISOMESH_REQUIRES(live_mutex_);
  // Tells how far it is, where that is news.
  void note(const Lease& lease, const Progress& progress);
  // A later run of the job stays known.
  void forget_run(const std::string& id, std::uint64_t fence);

  // For one job that has become ready, or for more.
  void wake_a_worker();
  void wake_all_workers();

  const BlobStore& blobs_;
  const JobStoreOptions options_;
  const std::string select_;
  std::atomic<bool> refusing_ = false;

  mutable Mutex live_mutex_;
  std::map<std::string, Live> live_ ISOMESH_GUARDED_BY(live_mutex_);  // of running jobs

 private:
  // Whether the job failed because of a damaged volume that is intact now.
  bool is_repaired(const Job& job) const;

  SqlDatabase& records_;

  Mutex work_mutex_;
  Condition work_;
  // Grows whenever a job may have become ready.
  std::uint64_t work_generation_ ISOMESH_GUARDED_BY(work_mutex_) = 0;
};

// Since one time of the tables until another, in milliseconds; never nothing.
double milliseconds_between(std::int64_t begin_us, std::int64_t end_us);

inline std::int64_t microseconds(std::chrono::milliseconds time) {
  return std::chrono::microseconds(time).count();
}

}  // namespace isomesh::store
