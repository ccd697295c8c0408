// The queue of jobs and what became of them: the interface behind which engines stand.
//
// The order that loses nothing: a volume's blob, its record, then submit; a worker writes the
// mesh's blobs, then finish. So a record never names a blob that is not there.
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

// Who asks: an owner sees its own only, and what is another's is "not found". Empty (nullopt) is
// the service itself, which sees everything. The owner is "" where no tokens are configured.
using Viewer = std::optional<std::string>;

struct JobSpec {
  std::string owner;
  JobParameters parameters;
  std::string idempotency_key;  // within the owner's; empty: none
  std::string request_digest;   // of the request with the key: tells a retry from another request
};

struct Submission {
  enum class Kind {
    kNew,
    kExisting,     // the job that the same key and request made before
    kConflict,     // the key came with another request before
    kBusy,         // nothing was stored: the queue is full, or accepts nothing any more
    kOwnersShare,  // nothing was stored: the owner has its share of the queue
  };

  Kind kind = Kind::kNew;
  Job job;                              // of kNew and kExisting
  std::chrono::seconds retry_after{0};  // of kBusy and kOwnersShare
};

// The submission's job. Throws Error kKeyReused for kConflict, kUnavailable for kBusy and
// kTooManyRequests for kOwnersShare.
const Job& job_of(const Submission& submission);

// A worker's right to run a job until its time is over. The fence grows with every claim of a job:
// whoever holds an older one can neither renew nor finish.
struct Lease {
  std::string id;
  std::uint64_t fence = 0;
  int attempt = 0;  // 1 for the first
  std::string owner;
  JobParameters parameters;
};

enum class Standing {
  kOk,
  kCancel,  // the lease holds, but the job is to be stopped: finish it without mesh and error
  kLost,    // the time is over or somebody else holds it: nothing of this run counts
};

// How far a running job is.
struct Progress {
  Stage stage = Stage::kLoad;
  double share = 0;  // 0..1 of the whole job
  Timing timing;     // of the stages that have ended
};

// How a run ended. A cancelled run has neither mesh nor error.
struct Outcome {
  std::optional<MeshSummary> mesh;
  std::optional<Problem> error;
  // The error may not come again: the job waits a while and is run again, unless this was its last
  // attempt.
  bool may_retry = false;
  Timing timing;
};

// What the service itself wants to know about a job.
struct JobAccount {
  Job job;
  int attempts = 0;  // that count; none for a job that took the mesh of another
};

enum class EventKind {
  kStage,     // queued, or at a stage of its run
  kProgress,  // further in the same stage
  kDone,      // in a final state
};

// What happened to a job. Queued, claimed and done are kept; what a run tells on its way is not,
// and a reader that comes late, or asks another process than the one that runs it, may miss some of
// it.
struct Event {
  // Grows, also over restarts, and is the same for all processes that share the records; whoever
  // goes on after one that it has seen misses none that is kept. It is no time.
  std::uint64_t id = 0;
  std::string owner;
  std::string job;
  EventKind kind = EventKind::kStage;
  JobState state = JobState::kQueued;
  Stage stage = Stage::kQueue;
  double progress = 0;
  bool is_elsewhere = false;  // another process did it, and tells its log and metrics

  bool operator==(const Event&) const = default;
};

// Which ended jobs are asked for.
enum class Ended {
  kAll,
  kWithMesh,  // those whose end frees room
};

struct QueueDepth {
  std::array<std::size_t, 3> queued = {};  // by Priority
  std::size_t running = 0;
  std::size_t waiting_for_disk = 0;  // of the queued

  std::size_t all_queued() const { return queued[0] + queued[1] + queued[2]; }
};

struct JobStoreOptions {
  std::size_t max_queued = 1000;                // a longer queue accepts nothing
  int attempts = 3;                             // how often a job is begun that fails
  std::chrono::milliseconds retry_delay{1000};  // after the first attempt; four times it after each
  std::string mesher_version = {};              // results of another one are not reused
  // Of engines that several processes share: for how long after an outage leases of others that ran
  // out meanwhile are left to whoever holds them. All see the outage, and a holder tries all the
  // time, so each has renewed by then if it is still there.
  std::chrono::milliseconds grace{10'000};
  // By which leases are renewed and outages are measured.
  std::function<std::chrono::steady_clock::time_point()> now = std::chrono::steady_clock::now;
  // How long a run is expected to take. Owners take turns by it; it is asked once for each job,
  // when that is submitted.
  std::function<double(const Volume&, const JobParameters&)> expected_ms =
      [](const Volume&, const JobParameters&) { return 1000.0; };
};

// Thread safe. Every verb is one transaction; nothing is held open between them. All may throw
// Error kOutOfSpace (then nothing has changed), kInternal, or kUnavailable where the records are
// kept elsewhere and do not answer. What has expired is kGone for some time, and kNotFound later.
//
// Several processes may share the records, where the engine can that. What is said of one job is
// then true over all of them: one of those alike runs, one key is one job, one end is told once. A
// lease is held by one life of one process, and is over when the engine's clock says so, whatever
// the process's own says. One that is over is anybody's to reap; its holder may still renew it, or
// finish, if nobody has reaped it yet and the engine can tell. What a process remembers besides is
// never what decides. Every verb may be interrupted between the engine and the process, and is then
// asked again by the store itself: a second submit or finish of the same thing is the first one.
class JobStore {
 public:
  virtual ~JobStore() = default;

  // Stores a job. One whose mesh the owner has already, undamaged, is finished at once, with
  // `reused` set.
  // Throws Error kNotFound or kGone when the owner has no such volume.
  virtual Submission submit(const JobSpec& spec) = 0;

  // Has the mesh of a job that succeeded made again, because its blobs are damaged: by a job like
  // it, which makes the same bytes. Returns that job: one that is under way already, or has failed,
  // or a new one. If the earlier one failed because the volume was damaged, and the volume is
  // intact now, a new one is submitted. Throws Error kNotFound or kGone, kGone also when the mesh
  // cannot be made again, and kUnavailable when the queue is full.
  virtual Job remake(const std::string& id) = 0;

  // The next job for `lease` from now: by priority, then by turns of the owners (sql/turns.h), then
  // by age. A job whose like is running for the same owner is left until that one has ended. Empty
  // when there is none.
  virtual std::optional<Lease> claim(const std::string& worker,
                                     std::chrono::milliseconds lease) = 0;

  // Returns when a claim may succeed, `longest` is over or `stop` is requested. True: try.
  virtual bool wait_for_work(const std::stop_token& stop, std::chrono::milliseconds longest) = 0;

  // Prolongs the lease to `length` from now and tells how far the job is. Meant to be called often:
  // it does not reach the disk.
  virtual Standing renew(const Lease& lease, const Progress& progress,
                         std::chrono::milliseconds length) = 0;

  // Ends a run. A job that was asked to cancel ends cancelled, whatever the outcome; jobs like one
  // that succeeded end with it. False when the lease is lost: then nothing has changed.
  virtual bool finish(const Lease& lease, const Outcome& outcome) = 0;

  // Gives a job back that could not be run now; it is claimed again after `delay`, and the attempt
  // does not count. Until then it says what it waits for. One that was asked to cancel ends
  // cancelled. False when the lease is lost.
  virtual bool put_back(const Lease& lease, std::chrono::milliseconds delay,
                        std::optional<WaitingFor> waiting_for = {}) = 0;

  // Ends the runs whose leases have run out, and those whose process is known to be gone: their
  // jobs are queued again, or are cancelled. No attempt is counted, however often that happens: it
  // is the service that ended or stood still. Anyone may call. Returns how many there were.
  virtual std::size_t reap() = 0;

  // A queued job never runs, a running one is asked to stop, a finished one stays as it is. Throws
  // Error kNotFound or kGone.
  virtual Job cancel(const Viewer& viewer, const std::string& id) = 0;

  // Throws Error kNotFound or kGone.
  virtual Job get(const Viewer& viewer, const std::string& id) const = 0;

  // Whoever owns it. Throws Error kNotFound or kGone.
  virtual JobAccount account(const std::string& id) const = 0;

  // Newest first; at most `limit` that are older than the job `after` (empty: from the newest).
  virtual std::vector<Job> list(const Viewer& viewer, std::optional<JobState> state,
                                const std::string& after, std::size_t limit) const = 0;

  // What happened after the event `since` to one job, or to all with an empty id; oldest first, at
  // most some hundred. Waits for at most `timeout` while there is nothing.
  virtual std::vector<Event> events(const Viewer& viewer, const std::string& job,
                                    std::uint64_t since,
                                    std::chrono::milliseconds timeout) const = 0;

  // The id of the latest event, for those who want what comes after it.
  virtual std::uint64_t last_event() const = 0;

  // Whether the records can be read now.
  virtual bool answers() const = 0;

  // Of the jobs that the viewer sees.
  virtual QueueDepth depth(const Viewer& viewer) const = 0;

  // True when submit would answer kBusy.
  virtual bool is_full() const = 0;

  // No job is accepted any more.
  virtual void refuse_new() = 0;

  // The same, and everybody who waits gets what there is.
  virtual void close() = 0;

  // Jobs that ended, as the filter says, the oldest first, at most `limit`.
  virtual std::vector<Expirable> ended(const ExpiryFilter& filter, Ended which,
                                       std::size_t limit) const = 0;

  // Removes ended jobs with their events, in their order, until that frees `enough` bytes: until no
  // record names blobs of so many bytes any more. One that is gone already is passed over. The
  // blobs themselves stay for BlobStore::sweep.
  virtual Expired expire(std::span<const Expirable> jobs, std::uint64_t enough) = 0;

  // The turn to remove what is not to be kept, which one of those that share the records has at a
  // time: it is over when what is returned goes. Null while another has it.
  virtual std::shared_ptr<const void> turn_to_remove() = 0;

  // Of the blobs that meshes name, each counted once.
  virtual std::uint64_t named_bytes() const = 0;
  virtual OwnedBytes owned_bytes() const = 0;

  // When the run began that lasts longest, whoever runs it; empty when nothing runs. Blobs that
  // were stored since then may be about to be named.
  virtual std::optional<std::chrono::steady_clock::time_point> oldest_run() const = 0;

  // Ids of jobs and volumes that expired before that time are not found from now on.
  virtual void forget_expired(Time before) = 0;

  virtual void forget_events(Time before) = 0;
};

}  // namespace isomesh::store
