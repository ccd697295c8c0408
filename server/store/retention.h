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
  // How long finished jobs are kept with their meshes, and volumes that no job has used since.
  std::chrono::milliseconds keep = std::chrono::days(30);
  // What all volumes and meshes may take; the oldest go first. 0: whatever the disk holds.
  std::uint64_t max_bytes = 0;
  // How long an id is known as expired after it is gone.
  std::chrono::milliseconds remember = std::chrono::days(90);
  // A blob is stored first and named by a record later. So one that no record names is removed only
  // when it was stored this long ago, and this long before the oldest run that is under way began.
  std::chrono::milliseconds grace = std::chrono::minutes(2);
  // How long blobs that no record names, and of which nobody knows why, lie in quarantine.
  std::chrono::milliseconds quarantine = std::chrono::days(7);
  // How long no sweep follows one that found too many of those.
  std::chrono::milliseconds sweep_pause = std::chrono::hours(1);
  // The time, as far as it can be believed.
  std::function<Time()> now = [] { return std::chrono::system_clock::now(); };
};

// Keeps the stores from growing for ever, and a node's folder of unfinished files. Never touches
// what a job that is queued or runs needs. Logs what expires, and why. Thread safe; what it is made
// of must outlive it.
class Retention {
 public:
  struct Gone {
    std::size_t jobs = 0;
    std::size_t volumes = 0;
    std::size_t blobs = 0;        // of what expired, or out of quarantine
    std::size_t quarantined = 0;  // blobs that no record names although none expired
    std::size_t left = 0;         // those that were too many to be put into quarantine at once
  };

  Retention(JobStore& jobs, VolumeStore& volumes, const BlobStore& blobs,
            std::filesystem::path scratch, const RetentionOptions& options)
      : jobs_(jobs),
        volumes_(volumes),
        blobs_(blobs),
        scratch_(std::move(scratch)),
        options_(options) {}

  // Lets what is too old or too much expire, then removes the files that nothing names any more. To
  // be called again and again. Throws Error kOutOfSpace or kInternal.
  Gone enforce();

  // Lets the oldest expire until `bytes` more fit. Throws Error kOutOfSpace when they cannot.
  void make_room(std::uint64_t bytes);

  // What the blobs of all records take, each counted once.
  std::uint64_t named_bytes() const;

 private:
  Names names() const;
  void expire_old(Time now, Gone& gone) ISOMESH_REQUIRES(mutex_);
  // False when what queued and running jobs need is more than that.
  bool shrink_to(std::uint64_t max_bytes, Gone& gone) ISOMESH_REQUIRES(mutex_);
  std::uint64_t garbage_bytes() const ISOMESH_REQUIRES(mutex_);
  std::vector<Expirable> oldest(const ExpiryFilter& filter, Ended which) const;
  struct Superfluous {
    std::vector<Expirable> items;
    std::uint64_t enough = 0;  // bytes of them; after these it may be another owner's turn
  };
  Superfluous superfluous() const;
  class Report;
  void expire(std::span<const Expirable> items, std::uint64_t enough, Gone& gone, Report& report)
      ISOMESH_REQUIRES(mutex_);
  Steady unsettled_since() const;
  std::size_t erase_garbage() ISOMESH_REQUIRES(mutex_);
  void sweep_blobs(Gone& gone);
  void sweep_scratch(Time now) const;
  void forget(Time now);

  JobStore& jobs_;
  VolumeStore& volumes_;
  const BlobStore& blobs_;
  const std::filesystem::path scratch_;
  const RetentionOptions options_;
  // Two threads that make room at the same time would make twice as much.
  Mutex mutex_;
  // Blobs that expired records named, and that are still there.
  std::vector<std::string> garbage_ ISOMESH_GUARDED_BY(mutex_);
  Steady next_sweep_ ISOMESH_GUARDED_BY(mutex_);
};

}  // namespace isomesh::store
