#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "base/mutex.h"
#include "server/store/blob_store.h"
#include "server/store/job_store.h"
#include "server/store/volume_store.h"

namespace isomesh::store {

struct RetentionOptions {
  // Finished jobs, their meshes and unused volumes are kept this long.
  std::chrono::milliseconds keep = std::chrono::days(30);
  // Limit for all volumes and meshes; 0: no limit but the disk.
  std::uint64_t max_bytes = 0;
  // Ids of expired records are remembered this long.
  std::chrono::milliseconds remember = std::chrono::days(90);
  // A blob is stored before a record names it. So an unnamed blob is removed only if it was stored
  // this long ago, and this long before the oldest current run began.
  std::chrono::milliseconds grace = std::chrono::minutes(2);
  // Unnamed blobs of unknown origin stay in quarantine this long.
  std::chrono::milliseconds quarantine = std::chrono::days(7);
  // Pause of sweeping after a sweep that found too many of them.
  std::chrono::milliseconds sweep_pause = std::chrono::hours(1);
  // The believed time.
  std::function<Time()> now = [] { return std::chrono::system_clock::now(); };
};

// Limits the growth of the stores and of a node's scratch folder. Never removes what a queued or
// running job needs. Logs what expires, and why. Thread safe; its dependencies must outlive it.
class Retention {
 public:
  struct Gone {
    std::size_t jobs = 0;
    std::size_t volumes = 0;
    std::size_t blobs = 0;        // of expired records, or out of quarantine
    std::size_t quarantined = 0;  // unnamed blobs although nothing expired
    std::size_t left = 0;         // further ones, too many to quarantine at once
  };

  Retention(JobStore& jobs, VolumeStore& volumes, BlobStore& blobs, std::filesystem::path scratch,
            const RetentionOptions& options)
      : jobs_(jobs),
        volumes_(volumes),
        blobs_(blobs),
        scratch_(std::move(scratch)),
        options_(options) {}

  // Expires records that are too old or exceed the limit, then removes unnamed files. Call
  // periodically. Throws Error kOutOfSpace or kInternal.
  Gone enforce();

  // Expires the oldest data of the owner with most data, counted with what comes, until that fits.
  // Throws Error kOutOfSpace if that is impossible.
  void make_room(const Incoming& incoming);

  // Total size of the blobs that records name; each counts once.
  std::uint64_t named_bytes() const;

 private:
  Names names() const;
  void expire_old(Time now, Gone& gone) ISOMESH_REQUIRES(mutex_);
  // Keeps the limit. Returns false if queued and running jobs need too much for that.
  bool shrink_for(const Incoming& incoming, Gone& gone) ISOMESH_REQUIRES(mutex_);
  std::uint64_t garbage_bytes() const ISOMESH_REQUIRES(mutex_);
  std::vector<Expirable> oldest(const ExpiryFilter& filter, Ended which) const;
  struct Superfluous {
    std::vector<Expirable> items;
    std::uint64_t enough = 0;  // bytes to free before another owner may have more data
  };
  Superfluous superfluous(const Incoming& incoming) const;
  class Report;
  void expire(std::span<const Expirable> items, std::uint64_t enough, Gone& gone, Report& report)
      ISOMESH_REQUIRES(mutex_);
  Steady spare_since() const;
  std::size_t erase_garbage() ISOMESH_REQUIRES(mutex_);
  void sweep_blobs(Gone& gone);
  void sweep_scratch(Time now);
  void forget(Time now);

  JobStore& jobs_;
  VolumeStore& volumes_;
  BlobStore& blobs_;
  const std::filesystem::path scratch_;
  const RetentionOptions options_;
  // Serialises callers of make_room(); otherwise two would free twice as much.
  Mutex mutex_;
  // Blobs of expired records that are not erased yet.
  std::vector<std::string> garbage_ ISOMESH_GUARDED_BY(mutex_);
  Steady next_sweep_ ISOMESH_GUARDED_BY(mutex_);
};

}  // namespace isomesh::store
