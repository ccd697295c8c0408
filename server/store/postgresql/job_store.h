#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/store/postgresql/database.h"
#include "server/store/postgresql/event_feed.h"
#include "server/store/postgresql/messages.h"
#include "server/store/sql/job_store.h"

namespace isomesh::store::postgresql {

// Jobs in a database that several processes share. A lease is a row that names a node
// (Database::node) and expires by the database's clock. Its holder keeps it as long as the row
// exists. Progress reaches the database at most twice a second, and the other processes within
// another second.
class PostgresJobStore : public SqlJobStore {
 public:
  // `database` and `blobs` must outlive this object.
  PostgresJobStore(Database& database, BlobStore& blobs, JobStoreOptions options);

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
    feed_.fetch();
    return feed_.events(viewer, job, since, timeout);
  }
  std::uint64_t last_event() const override { return feed_.last(); }
  bool responds() const override { return database_.responds(); }
  std::shared_ptr<const void> claim_removal() override;
  std::optional<Steady> oldest_run() const override;
  void forget_events(Time before) override;

 private:
  struct Ending;

  std::optional<Submission> try_to_submit(const JobSpec& spec, bool may_reuse) override;
  Row row_of(const Rows& rows) const override;
  std::optional<std::chrono::microseconds> until_ready() const override;
  void tell(Event event, std::int64_t transaction) override {
    feed_.tell(std::move(event), transaction);
  }
  void close_events() override { feed_.close(); }

  Job cancelled(Job job, std::int64_t accepted) const;
  std::string cancelled_record(const Row& row) const;
  // Claims the next job in the database; empty if none is ready. Sets `asked` to the time of the
  // request.
  std::optional<Rows> take_next(const std::string& worker, std::chrono::milliseconds lease,
                                Steady& asked);
  Lease begin_run(const Rows& claimed, const Job& job, Steady asked,
                  std::chrono::milliseconds lease);
  // Makes a queued job of an older version one of this version, so that its mesh gets the key of
  // the version that makes it. Takes a row of claim_job().
  void adopt(const Rows& older);
  // Ends the run of a job whose record is damaged.
  void fail_damaged(const std::string& id, std::uint64_t fence);
  bool end_run(const std::string& id, std::uint64_t fence, const Ending& ending);
  std::optional<Live> live_run(const Lease& lease) const;
  bool on_news(const News& news);
  // True if the database has responded for so long that every living holder has renewed its lease.
  bool has_responded_for_long() const;
  void note_response();
  void wake_workers();

  Database& database_;
  mutable Mutex responds_mutex_;
  std::optional<Steady> responded_
      ISOMESH_GUARDED_BY(responds_mutex_);  // the last success of reap()
  // The end of the last outage, or the start.
  Steady responds_since_ ISOMESH_GUARDED_BY(responds_mutex_);
  mutable EventFeed feed_;
  Messages messages_;  // last: its thread uses the other members
};

}  // namespace isomesh::store::postgresql
