#include "server/jobs/library/blob_eraser.h"

#include <chrono>
#include <exception>
#include <memory>
#include <span>

#include "base/log.h"

namespace isomesh::jobs {
namespace {

// Erasing waits this long, so that it does not compete for a processor with the thread that sends
// the response to the deletion.
constexpr std::chrono::milliseconds kPause{100};

}  // namespace

void BlobEraser::erase(const std::string& key) {
  const Lock lock(mutex_);
  waiting_.push_back(key);
  changed_.notify_all();
}

void BlobEraser::finish() {
  Lock lock(mutex_);
  ++hurries_;
  changed_.notify_all();
  changed_.wait(lock, [this]() ISOMESH_REQUIRES(mutex_) { return waiting_.empty(); });
  --hurries_;
}

void BlobEraser::run(const std::stop_token& stop) {
  Lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, stop, [this]() ISOMESH_REQUIRES(mutex_) { return !waiting_.empty(); });
    if (waiting_.empty()) return;
    changed_.wait_for(lock, stop, kPause,
                      [this]() ISOMESH_REQUIRES(mutex_) { return hurries_ > 0; });
    const std::string key = waiting_.front();
    lock.unlock();
    erase_now(key);
    lock.lock();
    waiting_.pop_front();
    changed_.notify_all();
  }
}

void BlobEraser::erase_now(const std::string& key) {
  try {
    // Freeing the bytes of a large blob takes long. Holding them until the lock is released keeps
    // others from waiting for it.
    const std::shared_ptr<const void> held = blobs_.hold_bytes(key);
    const std::scoped_lock lock(coming_);
    const auto names = [this](const std::string& asked) { return volumes_.names(asked); };
    // Another daemon may have stored the same blob at any time and be about to name it, so every
    // blob counts as recent.
    blobs_.erase_unnamed(std::span(&key, 1), store::Steady(), names);
  } catch (const std::exception& error) {
    log_error("the samples of a deleted volume could not be erased and are removed later: {}",
              error.what());
  }
}

}  // namespace isomesh::jobs
