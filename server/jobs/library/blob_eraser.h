#pragma once

#include <deque>
#include <filesystem>
#include <functional>
#include <set>
#include <span>
#include <stop_token>
#include <string>
#include <thread>

#include "base/mutex.h"
#include "server/store/blob_store.h"
#include "server/store/volume_store.h"

namespace isomesh::jobs {

// Erases the files of deleted volumes and jobs in a thread of its own. So the response time of a
// deletion reveals neither their size nor whether another owner still has them. What it did not get
// to before the process ended, it erases after the next start. Thread safe.
class BlobEraser {
 public:
  // `marks` is a folder with an empty file for each blob to erase. The other arguments must outlive
  // this object.
  BlobEraser(store::BlobStore& blobs, const store::VolumeStore& volumes,
             std::filesystem::path marks);

  // Waits only for the blob that is being erased: there may be many, and each takes long if the
  // database or the storage does not respond.
  ~BlobEraser() = default;

  // Calls `erase_records` and then queues the blobs that it says are going, also if that throws.
  // Each is erased soon, unless a record names it by then.
  void erase(const std::function<void(const store::BlobsGoing& going)>& erase_records);

  // Returns once all queued blobs are erased, or `stop` is requested.
  void finish(const std::stop_token& stop = {});

 private:
  void note(std::span<const std::string> keys);
  void queue(std::span<const std::string> keys);
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
