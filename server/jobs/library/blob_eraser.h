#pragma once

#include <deque>
#include <filesystem>
#include <shared_mutex>
#include <stop_token>
#include <string>
#include <thread>

#include "base/mutex.h"
#include "server/store/blob_store.h"
#include "server/store/volume_store.h"

namespace isomesh::jobs {

// Erases the samples of deleted volumes in a thread of its own. So the response time of a deletion
// reveals neither their size nor whether another owner still has them. What it did not get to
// before the process ended, it erases after the next start. Thread safe.
class BlobEraser {
 public:
  // `erasing` is held shared by callers of erase(). `marks` is a folder with an empty file for each
  // queued blob. The other arguments must outlive this object.
  BlobEraser(store::BlobStore& blobs, const store::VolumeStore& volumes, std::shared_mutex& erasing,
             std::filesystem::path marks);

  // Waits only for the blob that is being erased: there may be many, and each takes long if the
  // database or the storage does not respond.
  ~BlobEraser() = default;

  // Queues the blob. It is erased soon, unless a record names it by then. To be called before its
  // record is erased, with `erasing` held shared until that has happened.
  void erase(const std::string& key);

  // Returns once all queued blobs are erased, or `stop` is requested.
  void finish(const std::stop_token& stop = {});

 private:
  void run(const std::stop_token& stop);
  // Returns false if it failed.
  bool erase_now(const std::string& key);

  store::BlobStore& blobs_;
  const store::VolumeStore& volumes_;
  std::shared_mutex& erasing_;
  const std::filesystem::path marks_;
  Mutex mutex_;
  Condition changed_;
  std::deque<std::string> waiting_ ISOMESH_GUARDED_BY(mutex_);  // the first is being erased
  // Callers of finish() that are waiting.
  int hurries_ ISOMESH_GUARDED_BY(mutex_) = 0;
  // Last, because it uses the other members.
  std::jthread thread_;
};

}  // namespace isomesh::jobs
