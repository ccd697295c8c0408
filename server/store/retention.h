#pragma once

#include <chrono>
#include <cstdint>

#include "server/store/data_folder.h"
#include "server/store/database.h"
#include "server/store/file_blob_store.h"

namespace isomesh::store {

struct RetentionOptions {
  // How long finished jobs are kept with their meshes, and volumes that no job has used since.
  std::chrono::milliseconds keep = std::chrono::days(30);
  // What all volumes and meshes may take; the oldest go first. 0: whatever the disk holds.
  std::uint64_t max_bytes = 0;
  // How long an id is known as expired after it is gone.
  std::chrono::milliseconds remember = std::chrono::days(90);
  // How young a blob that nothing names must be to be left alone: between its last byte and its
  // naming lies a transaction, and a worker's run besides, which is reckoned with.
  std::chrono::milliseconds grace = std::chrono::minutes(2);
};

// What keeps a data folder from growing for ever. Never touches what a job that is queued or runs
// needs. Thread safe; what it is made of must outlive it.
class Retention {
 public:
  struct Gone {
    std::size_t jobs = 0;
    std::size_t volumes = 0;
    std::size_t blobs = 0;
  };

  Retention(const DataFolder& folder, Database& database, const FileBlobStore& blobs,
            const RetentionOptions& options)
      : folder_(folder), database_(database), blobs_(blobs), options_(options) {}

  // Lets go of what is too old or too much, then of the files that nothing names any more. To be
  // called again and again. Throws Error kOutOfSpace or kInternal.
  Gone enforce();

  // Lets go of the oldest until `bytes` more fit. Throws Error kOutOfSpace when they cannot.
  void make_room(std::uint64_t bytes);

  // What the named blobs take, each counted once.
  std::uint64_t named_bytes();

 private:
  Gone expire_old();
  // False when what live jobs need is more than that.
  bool expire_beyond(std::uint64_t max_bytes, Gone& gone);
  std::size_t sweep_blobs();
  void sweep_scratch();
  void forget();

  const DataFolder& folder_;
  Database& database_;
  const FileBlobStore& blobs_;
  const RetentionOptions options_;
};

}  // namespace isomesh::store
