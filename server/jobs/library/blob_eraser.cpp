#include "server/jobs/library/blob_eraser.h"

#include <chrono>
#include <exception>
#include <memory>
#include <span>

#include "base/log.h"

namespace isomesh::jobs {
namespace {

// An answer is on its way then. The thread that sends it would wait for a processor meanwhile.
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
    // The disk takes long to free the bytes of a large one, and nobody is to wait for that.
    const std::shared_ptr<const void> held = blobs_.hold_bytes(key);
    const std::scoped_lock lock(coming_);
    const auto names = [this](const std::string& asked) { return volumes_.names(asked); };
    // Whoever of another daemon has stored it, at any time, may be about to name it.
    blobs_.erase_unnamed(std::span(&key, 1), store::Steady(), names);
  } catch (const std::exception& error) {
    log_error("the samples of a deleted volume could not be erased and are removed later: {}",
              error.what());
  }
}

}  // namespace isomesh::jobs
