#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <list>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <variant>
#include <vector>

#include "proto/types.h"
#include "server/store/blob_store.h"

namespace isomesh::store {

// A worker's right to run a job. The fence grows with every claim: whoever holds an older one can
// no longer report or finish.
struct Lease {
  std::string id;
  std::uint64_t fence = 0;
  JobParameters parameters;
  std::stop_token cancelled;
};

// How a run ended. A cancelled run has neither mesh nor error.
struct Outcome {
  std::optional<MeshSummary> mesh;
  std::optional<Problem> error;
};

// The jobs of this process: queue, running and the last finished ones, in memory. Its verbs are
// those of a store that survives a restart, which will stand in its place. Thread safe.
class JobStore {
 public:
  struct Limits {
    std::size_t max_queued = 1000;    // a queue that is longer answers "later"
    std::size_t max_finished = 1000;  // the oldest finished jobs beyond it are forgotten
  };

  // `blobs` must outlive it; the meshes of forgotten jobs are erased there.
  JobStore(const BlobStore& blobs, const Limits& limits) : blobs_(blobs), limits_(limits) {}

  // Throws Error kUnavailable when the queue is full or closed.
  Job submit(const JobParameters& parameters);

  // The next job by priority, then age; waits for one. Empty once `stop` is requested.
  std::optional<Lease> claim(const std::stop_token& stop);

  // What a running job does. False when the lease is not valid any more.
  bool report(const Lease& lease, Stage stage, double progress, const Timing& timing);

  // Ends a job; one that was asked to cancel ends cancelled whatever the outcome, and its mesh is
  // erased. False when the lease is not valid any more: then nothing has changed.
  bool finish(const Lease& lease, const Outcome& outcome, const Timing& timing);

  // Gives a job back, to be claimed again as if it had not run; one that was asked to cancel ends
  // cancelled.
  void put_back(const Lease& lease);

  // A queued job never runs, a running one is asked to stop, a finished one stays as it is. Throws
  // Error kNotFound.
  Job cancel(const std::string& id);

  // Throws Error kNotFound.
  Job get(const std::string& id) const;

  // The job when it is final or `wait` is over, whichever is first. Throws Error kNotFound.
  Job wait(const std::string& id, std::chrono::milliseconds wait) const;

  // Newest first; at most `limit` that are older than the job `after`.
  std::vector<Job> list(std::optional<JobState> state, const std::string& after,
                        std::size_t limit) const;

  // How many jobs are in that state.
  std::size_t count(JobState state) const;

  // True while a queued or running job needs the volume.
  bool needs_volume(const std::string& volume) const;

  bool is_full() const;

  // No job is accepted any more.
  void refuse_new();

  // The same, and everybody who waits for a job gets its present state.
  void close();

 private:
  struct Entry {
    Job job;
    std::uint64_t fence = 0;
    std::stop_source stop;
    std::chrono::steady_clock::time_point accepted = std::chrono::steady_clock::now();
  };

  Entry& entry_of(const std::string& id);
  const Entry& entry_of(const std::string& id) const;
  Entry* leased(const Lease& lease);
  void end(Entry& entry, JobState state);
  void forget_oldest();
  void release(const MeshSummary& mesh);
  void erase_unnamed();

  const BlobStore& blobs_;
  const Limits limits_;
  mutable std::mutex mutex_;  // guards everything below
  mutable std::condition_variable_any changed_;
  std::map<std::string, Entry> jobs_;              // ids sort by age
  std::array<std::deque<std::string>, 3> queues_;  // of each priority, oldest first
  std::deque<std::string> finished_;               // oldest first
  std::map<std::string, std::size_t> mesh_users_;  // how many jobs name each blob
  std::set<std::uint64_t> running_;                // the fences of running jobs
  // Blobs that no job names any more. A job that ran already when that happened may have stored the
  // same bytes and be about to name them, so they stay until all fences up to that one are gone.
  std::map<std::string, std::uint64_t> unnamed_;
  std::uint64_t last_fence_ = 0;
  bool refusing_ = false;
  bool closed_ = false;
};

}  // namespace isomesh::store
