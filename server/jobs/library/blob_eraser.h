#pragma once

#include <deque>
#include <shared_mutex>
#include <string>
#include <thread>

#include "base/mutex.h"
#include "server/store/blob_store.h"
#include "server/store/volume_store.h"

namespace isomesh::jobs {

// Erases the samples of deleted volumes in a thread of its own. So the response time of a deletion
// reveals neither their size nor whether another owner still has them. Thread safe.
class BlobEraser {
 public:
  // `coming` is held shared while a blob and its record are added, and exclusively while a blob is
  // erased. All arguments must outlive this object.
  BlobEraser(store::BlobStore& blobs, const store::VolumeStore& volumes, std::shared_mutex& coming)
      : blobs_(blobs),
        volumes_(volumes),
        coming_(coming),
        thread_([this](const std::stop_token& stop) { run(stop); }) {}

  // Erases all queued blobs first.
  ~BlobEraser() = default;

  // Queues the blob. It is erased soon, unless a record names it by then.
  void erase(const std::string& key);

  // Returns once all queued blobs are erased.
  void finish();

 private:
  void run(const std::stop_token& stop);
  void erase_now(const std::string& key);

  store::BlobStore& blobs_;
  const store::VolumeStore& volumes_;
  std::shared_mutex& coming_;
  Mutex mutex_;
  Condition changed_;
  std::deque<std::string> waiting_ ISOMESH_GUARDED_BY(mutex_);  // the first is being erased
  // Callers of finish() that are waiting.
  int hurries_ ISOMESH_GUARDED_BY(mutex_) = 0;
  // Last, because it uses the other members.
  std::jthread thread_;
};

}  // namespace isomesh::jobs
