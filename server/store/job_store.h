// Interface of the queue of jobs and of their records.
//
// The order of operations prevents losses: first a volume's blob, then its record, then submit; a
// worker first writes the mesh's blobs, then calls finish. So a record never names a missing blob.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "proto/types.h"
#include "server/store/expiry.h"

namespace isomesh::store {

// The identity that requests data. An owner sees only its own records; those of others are "not
// found". Empty (nullopt) is the service itself, which sees everything. Without configured tokens
// the owner is "".
using Viewer = std::optional<std::string>;

struct JobSpec {
  std::string owner;
  JobParameters parameters;
  std::string idempotency_key;  // unique within the owner's; empty: none
  std::string request_digest;   // distinguishes a retry with the same key from another request
};

struct Submission {
  enum class Kind {
    kNew,
    kExisting,     // the job submitted before with the same key and request
    kConflict,     // the key was used for another request
    kBusy,         // nothing was stored: the queue or its urgent part is full, or it is closed
    kOwnersShare,  // nothing was stored: the owner's share of the queue is full
  };

  Kind kind = Kind::kNew;
  Job job;  // for kNew and kExisting
};

// Returns the submission's job. Throws Error kKeyReused for kConflict, kUnavailable for kBusy and
// kTooManyRequests for kOwnersShare.
const Job& job_of(const Submission& submission);

// A worker's right to run a job for a limited time. Each claim of a job increments its fence. A
// holder with an older fence can neither renew nor finish.
struct Lease {
  std::string id;
  std::uint64_t fence = 0;
  int attempt = 0;  // starts at 1
  std::string owner;
  JobParameters parameters;
};

enum class Standing {
  kOk,
  kCancel,  // the lease holds, but the job is cancelled: finish without mesh and error
  kLost,    // the lease expired or another worker has it: discard this run
};

struct Progress {
  Stage stage = Stage::kLoad;
  double share = 0;  // of the whole job, 0..1
  Timing timing;     // of completed stages
};

// The result of a run. A cancelled run has neither mesh nor error.
struct Outcome {
  std::optional<MeshSummary> mesh;
  std::optional<Problem> error;
  // The error may be temporary: the job is retried after a delay, unless this was its last attempt.
  bool may_retry = false;
  Timing timing;  // with a mesh; otherwise the job keeps the progress of its last renewal
};

// The jobs that a list has; all if it is empty. Times are those that jobs tell (Job::created).
struct JobFilter {
  std::optional<JobState> state = {};
  std::optional<std::string> volume = {};
  std::optional<Time> since = {};  // submitted then or later
  std::optional<Time> until = {};  // submitted before
};

// Data about a job for the service itself.
struct JobAccount {
  Job job;
  int attempts = 0;  // that count; 0 for a job that reused a mesh
};

enum class EventKind {
  kStage,     // queued, or entered a stage of its run
  kProgress,  // advanced in the same stage
  kDone,      // reached a final state
};

// A change of a job. The events queued, claimed and done are stored. Progress is not: readers that
// are late, or that ask another process than the one running the job, may miss some of it.
struct Event {
  // Increases, also over restarts, and is common to all processes that share the records. A reader
  // that continues after an id it has seen misses no stored event. Not a time.
  std::uint64_t id = 0;
  std::string owner;
  std::string job;
  EventKind kind = EventKind::kStage;
  JobState state = JobState::kQueued;
  Stage stage = Stage::kQueue;
  double progress = 0;
  bool is_elsewhere = false;  // done by another process, which logs and counts it

  bool operator==(const Event&) const = default;
};

enum class Ended {
  kAll,
  kWithMesh,  // those whose expiry frees space
};

struct QueueDepth {
  std::array<std::size_t, 3> queued = {};  // by Priority
  std::size_t running = 0;
  std::size_t waiting_for_disk = 0;  // of the queued jobs

  std::size_t all_queued() const { return queued[0] + queued[1] + queued[2]; }
};

struct JobStoreOptions {
  std::size_t max_queued = 1000;  // a longer queue rejects submissions
  int attempts = 3;               // of a failing job
  // After the first attempt; four times longer after each further one.
  std::chrono::milliseconds retry_delay{1000};
  std::string mesher_version = {};  // meshes of other versions are not reused
  // For engines shared by several processes: of the jobs that this process accepts. Newer jobs are
  // left to newer processes, and an older job becomes one of this version when it is claimed.
  int job_version = 1;
  // For engines shared by several processes: the time after an outage during which expired leases
  // of other processes are not reaped. All processes see the outage and holders keep trying to
  // renew, so a holder that is alive has renewed by then.
  std::chrono::milliseconds grace{10'000};
  // The clock for renewals and outages.
  std::function<std::chrono::steady_clock::time_point()> now = std::chrono::steady_clock::now;
  // The expected run time of a job. Owners take turns by it. Called once per job, at its
  // submission.
  std::function<double(const Volume&, const JobParameters&)> expected_ms =
      [](const Volume&, const JobParameters&) { return 1000.0; };
};

// Thread safe. Each method is one transaction; none stays open between calls. All may throw Error
// kOutOfSpace (nothing has changed), kInternal, or kUnavailable if a remote database does not
// respond. Expired records give kGone for some time, then kNotFound.
//
// Some engines let several processes share the records. The guarantees for a job then hold across
// all of them: of equal jobs only one runs, a key gives one job, an end is reported once. A lease
// belongs to one run of one process, and expires by the engine's clock, not by the process's.
// Anybody may reap an expired lease. Until then its holder may still renew it or finish, if the
// engine can tell. Nothing is decided by the memory of a process. A connection may break during any
// method; the store then repeats the call, and a second submit or finish of the same thing has no
// further effect.
class JobStore {
 public:
  virtual ~JobStore() = default;

  // Stores a job. If the owner has an intact mesh of an equal job, the job is finished at once,
  // with `reused` set, unless equal jobs come and go all the time. Throws Error kNotFound or kGone
  // if the owner has no such volume.
  virtual Submission submit(const JobSpec& spec) = 0;

  // Replaces a succeeded job's damaged mesh by submitting an equal job, which makes the same bytes.
  // Returns that job: an existing one that is queued, running or failed, or a new one. If the
  // existing one failed because the volume was damaged, and the volume is intact now, submits a new
  // one. Throws Error kNotFound; kGone, also if the mesh cannot be made again; kUnavailable if the
  // queue is full.
  virtual Job remake(const std::string& id) = 0;

  // Leases the next job for `lease` from now: by priority, then by turns of the owners
  // (sql/fair_queue.h), then by age. Skips a job while an equal one of the same owner runs. Empty
  // if there is none.
  virtual std::optional<Lease> claim(const std::string& worker,
                                     std::chrono::milliseconds lease) = 0;

  // Returns when a claim may succeed, `longest` has passed or `stop` is requested. True: try to
  // claim.
  virtual bool wait_for_work(const std::stop_token& stop, std::chrono::milliseconds longest) = 0;

  // Extends the lease to `length` from now and reports progress. Cheap, so call it often: it does
  // not write to disk.
  virtual Standing renew(const Lease& lease, const Progress& progress,
                         std::chrono::milliseconds length) = 0;

  // Ends a run. A cancelled job ends as cancelled, whatever the outcome. If it succeeded, equal
  // jobs end with the same mesh. Returns false if the lease is lost; then nothing has changed.
  virtual bool finish(const Lease& lease, const Outcome& outcome) = 0;

  // Returns a job that cannot run now to the queue, and reports what it waits for. It can be
  // claimed again after `delay`; the attempt does not count. A cancelled job ends as cancelled.
  // Returns false if the lease is lost.
  virtual bool put_back(const Lease& lease, std::chrono::milliseconds delay,
                        std::optional<WaitingFor> waiting_for = {}) = 0;

  // Ends runs with expired leases, and those of processes known to have died. Their jobs are queued
  // again, or end as cancelled. These attempts do not count, because the service failed and not the
  // job. Any process may call it. Returns the number of runs.
  virtual std::size_t reap() = 0;

  // Cancels a job: a queued one never runs, a running one is asked to stop, a finished one stays as
  // it is. Throws Error kNotFound or kGone.
  virtual Job cancel(const Viewer& viewer, const std::string& id) = 0;

  // Erases an ended job, its undelivered callback, and its events but the end, which readers may
  // still wait for. Its id is then kNotFound. Returns false, and changes nothing, if the job is
  // queued or running. Throws Error kNotFound or kGone.
  virtual bool erase(const Viewer& viewer, const std::string& id, const BlobsGoing& going = {}) = 0;

  // Throws Error kNotFound or kGone.
  virtual Job get(const Viewer& viewer, const std::string& id) const = 0;

  // For any owner. Throws Error kNotFound or kGone.
  virtual JobAccount account(const std::string& id) const = 0;

  // Those that match, newest first; at most `limit` jobs older than the job `after` (empty: from
  // the newest).
  virtual std::vector<Job> list(const Viewer& viewer, const JobFilter& filter,
                                const std::string& after, std::size_t limit) const = 0;

  // Events after `since` of one job, or of all if `job` is empty; oldest first, at most a few
  // hundred. Waits up to `timeout` if there are none.
  virtual std::vector<Event> events(const Viewer& viewer, const std::string& job,
                                    std::uint64_t since,
                                    std::chrono::milliseconds timeout) const = 0;

  // The id of the latest event, to follow later ones.
  virtual std::uint64_t last_event() const = 0;

  // True if the records can be read now.
  virtual bool responds() const = 0;

  // Counts jobs visible to the viewer.
  virtual QueueDepth depth(const Viewer& viewer) const = 0;

  // True if submit would return kBusy.
  virtual bool is_full() const = 0;

  // Rejects all further submissions.
  virtual void refuse_new() = 0;

  // As refuse_new(), and wakes all waiting callers.
  virtual void close() = 0;

  // Ended jobs that match the filter, oldest first, at most `limit`.
  virtual std::vector<Expirable> ended(const ExpiryFilter& filter, Ended which,
                                       std::size_t limit) const = 0;

  // Removes ended jobs, with their events but the end, in the given order, until that frees
  // `enough` bytes, that is, until no record names blobs of that total size. Skips jobs that are
  // already gone. BlobStore::sweep removes the blobs themselves.
  virtual Expired expire(std::span<const Expirable> jobs, std::uint64_t enough) = 0;

  // The lease for retention: of the processes that share the records, one has it at a time, until
  // it releases the result. Null if another process has it.
  virtual std::shared_ptr<const void> claim_removal() = 0;

  // Total size of the blobs that meshes name; each counts once.
  virtual std::uint64_t named_bytes() const = 0;
  virtual OwnedBytes owned_bytes() const = 0;

  // The start of the longest current run in any process; empty if none runs. Blobs stored since
  // then may be about to be named.
  virtual std::optional<std::chrono::steady_clock::time_point> oldest_run() const = 0;

  // Forgets the ids of jobs and volumes that expired before that time; they are then kNotFound.
  virtual void forget_expired(Time before) = 0;

  virtual void forget_events(Time before) = 0;
};

}  // namespace isomesh::store
