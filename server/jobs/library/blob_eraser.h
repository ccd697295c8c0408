#pragma once

#include <deque>
#include <filesystem>
#include <functional>
#include <set>
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
  // `marks` is a folder with an empty file for each blob to erase. The other arguments must outlive
  // this object.
  BlobEraser(store::BlobStore& blobs, const store::VolumeStore& volumes,
             std::filesystem::path marks);

  // Waits only for the blob that is being erased: there may be many, and each takes long if the
  // database or the storage does not respond.
  ~BlobEraser() = default;

  // Calls `erase_record` and then queues the blob, also if that throws. The blob is erased soon,
  // unless a record names it by then.
  void erase(const std::string& key, const std::function<void()>& erase_record);

  // Returns once all queued blobs are erased, or `stop` is requested.
  void finish(const std::stop_token& stop = {});

 private:
  void queue(const std::string& key);
  void run(const std::stop_token& stop);
  // Returns false if it failed.
  bool erase_now(const std::string& key);

  store::BlobStore& blobs_;
  const store::VolumeStore& volumes_;
  const std::filesystem::path marks_;
  Mutex mutex_;
  Condition changed_;
  std::multiset<std::string> coming_ ISOMESH_GUARDED_BY(mutex_);  // their records are being erased
  std::deque<std::string> waiting_ ISOMESH_GUARDED_BY(mutex_);    // the first is being erased
  // Callers of finish() that are waiting.
  int hurries_ ISOMESH_GUARDED_BY(mutex_) = 0;
  // Last, because it uses the other members.
  std::jthread thread_;
};

}  // namespace isomesh::jobs
