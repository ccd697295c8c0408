#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "base/mutex.h"
#include "server/store/blob_store.h"
#include "server/store/job_store.h"
#include "server/store/postgresql/database.h"
#include "server/store/postgresql/event_feed.h"
#include "server/store/postgresql/messages.h"

namespace isomesh::store::postgresql {

// Jobs in a database that several processes share. A lease is a row that names the life of a
// process (Database::node) and is over by the database's clock. What a run tells on its way reaches
// the database about once a second.
class PostgresJobStore : public JobStore {
 public:
  // Both must outlive it. `blobs` is asked whether a mesh that is to be reused is still there.
  PostgresJobStore(Database& database, const BlobStore& blobs, JobStoreOptions options);

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
  std::uint64_t last_event() const override { return feed_.last(); }
  bool answers() const override { return database_.answers(); }
  QueueDepth depth(const Viewer& viewer) const override;
  bool is_full() const override;
  void refuse_new() override { refusing_ = true; }
  void close() override;
  std::vector<Expirable> ended(const ExpiryFilter& filter, Ended which,
                               std::size_t limit) const override;
  Expired expire(std::span<const Expirable> jobs, std::uint64_t enough) override;
  std::shared_ptr<const void> turn_to_remove() override;
  std::uint64_t named_bytes() const override;
  OwnedBytes owned_bytes() const override;
  std::optional<Steady> oldest_run() const override;
  void forget_expired(Time before) override;
  void forget_events(Time before) override;

 private:
  struct Row;
  struct Ending;
  // A run that this process has claimed.
  struct Live {
    std::uint64_t fence = 0;
    Job job;  // as it was claimed
    std::int64_t accepted = 0;
    Steady claimed;
    Steady lease_until;  // as far as this process knows
    bool cancelling = false;
    std::optional<Progress> progress = {};  // none before the first renewal
    std::int64_t transaction = 0;           // that claimed it
    EventFeed::Clock::time_point told = {};
  };

  Row row_of(const Rows& rows) const;
  std::optional<Row> find(const Viewer& viewer, const std::string& id) const;
  // Throws Error kGone or kNotFound for a row that is not there.
  Row found(const Viewer& viewer, const std::string& id) const;
  Job with_progress(const Row& row) const;
  // What a job like it has made last, if there is such a job.
  struct Made {
    std::string job;
    std::optional<MeshSummary> mesh;  // empty when it is not there whole
  };
  std::optional<Made> made_like(const std::string& owner, const std::string& key) const;
  // Empty when its volume is not there.
  std::optional<std::string> result_key_of(const JobSpec& spec) const;
  bool has_expired(const JobSpec& spec) const;
  bool has_share(const JobSpec& spec) const;
  // One try; kind 5 of the function: empty.
  std::optional<Submission> try_to_submit(const JobSpec& spec, Job job);
  Job cancelled(Job job, std::int64_t accepted) const;
  bool end_run(const std::string& id, std::uint64_t fence, const Ending& ending);
  std::optional<Live> live_run(const Lease& lease) const;
  // Null when the process has no such run; to be called with the lock.
  Live* live(const Lease& lease) ISOMESH_REQUIRES(live_mutex_);
  void tell(const Lease& lease, const Progress& progress);
  void forget_run(const std::string& id, std::uint64_t fence);
  void hear(const News& news);
  void wake_workers();

  Database& database_;
  const BlobStore& blobs_;
  const JobStoreOptions options_;
  mutable EventFeed feed_;
  std::atomic<bool> refusing_ = false;

  mutable Mutex live_mutex_;
  std::map<std::string, Live> live_ ISOMESH_GUARDED_BY(live_mutex_);  // of running jobs

  Mutex work_mutex_;
  Condition work_;
  // Grows whenever a job may have become ready.
  std::uint64_t work_generation_ ISOMESH_GUARDED_BY(work_mutex_) = 0;

  Messages messages_;  // last: its thread uses the others
};

}  // namespace isomesh::store::postgresql
