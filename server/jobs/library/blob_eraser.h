#pragma once

#include <deque>
#include <shared_mutex>
#include <string>
#include <thread>

#include "base/mutex.h"
#include "server/store/blob_store.h"
#include "server/store/volume_store.h"

namespace isomesh::jobs {

// Takes the samples of erased volumes away in a thread of its own: how long an answer takes tells
// neither how large they were nor whether another owner has them still. Thread safe.
class BlobEraser {
 public:
  // `coming` is held by those who bring blobs and their records, and alone while a blob goes. All
  // must outlive this.
  BlobEraser(const store::BlobStore& blobs, const store::VolumeStore& volumes,
             std::shared_mutex& coming)
      : blobs_(blobs),
        volumes_(volumes),
        coming_(coming),
        thread_([this](const std::stop_token& stop) { run(stop); }) {}

  // What waits goes first.
  ~BlobEraser() = default;

  // Erases the blob soon, unless a record names it then.
  void erase(const std::string& key);

  // Waits until all that was to be erased is.
  void finish();

 private:
  void run(const std::stop_token& stop);
  void erase_now(const std::string& key);

  const store::BlobStore& blobs_;
  const store::VolumeStore& volumes_;
  std::shared_mutex& coming_;
  Mutex mutex_;
  Condition changed_;
  std::deque<std::string> waiting_ ISOMESH_GUARDED_BY(mutex_);  // the first is under way
  int hurries_ ISOMESH_GUARDED_BY(mutex_) = 0;                  // of those that wait for the end
  std::jthread thread_;                                         // last, because it uses the others
};

}  // namespace isomesh::jobs
