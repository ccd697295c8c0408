#include "server/jobs/library/blob_eraser.h"

#include <algorithm>
#include <chrono>
#include <exception>
#include <memory>
#include <span>
#include <utility>

#include "base/log.h"
#include "server/store/file.h"

namespace isomesh::jobs {
namespace {

// Erasing waits this long, so that it does not compete for a processor with the thread that sends
// the response to the deletion.
constexpr std::chrono::milliseconds kPause{100};

// Without a mark, the blob of a process that dies goes to quarantine first, as any file without a
// record does. A deletion does not fail for that, for instance on a full disk.
void mark(const std::filesystem::path& folder, std::span<const std::string> keys) {
  if (keys.empty()) return;
  try {
    for (const std::string& key : keys) {
      if (!std::filesystem::exists(folder / key)) store::File::create(folder / key);
    }
    store::sync_folder(folder);
  } catch (const std::exception& error) {
    log_warning("the deletion of files could not be noted: {}", error.what());
  }
}

std::deque<std::string> marked_in(const std::filesystem::path& folder) {
  std::deque<std::string> keys;
  std::error_code absent;
  for (const auto& entry : std::filesystem::directory_iterator(folder, absent)) {
    keys.push_back(entry.path().filename().string());
  }
  return keys;
}

}  // namespace

BlobEraser::BlobEraser(store::BlobStore& blobs, const store::VolumeStore& volumes,
                       std::filesystem::path marks)
    : blobs_(blobs),
      volumes_(volumes),
      marks_(std::move(marks)),
      waiting_(marked_in(marks_)),
      thread_([this](const std::stop_token& stop) { run(stop); }) {}

void BlobEraser::erase(const std::function<void(const store::BlobsGoing& going)>& erase_records) {
  std::vector<std::string> all;
  const auto going = [&](std::span<const std::string> keys) {
    note(keys);
    all.insert(all.end(), keys.begin(), keys.end());
    mark(marks_, keys);
  };
  try {
    erase_records(going);
  } catch (...) {
    queue(all);
    throw;
  }
  queue(all);
}

void BlobEraser::note(std::span<const std::string> keys) {
  const Lock lock(mutex_);
  coming_.insert(keys.begin(), keys.end());
}

void BlobEraser::queue(std::span<const std::string> keys) {
  const Lock lock(mutex_);
  for (const std::string& key : keys) {
    coming_.erase(coming_.find(key));
    waiting_.push_back(key);
  }
  changed_.notify_all();
}

void BlobEraser::finish(const std::stop_token& stop) {
  Lock lock(mutex_);
  ++hurries_;
  changed_.notify_all();
  changed_.wait(lock, stop, [this]() ISOMESH_REQUIRES(mutex_) { return waiting_.empty(); });
  --hurries_;
}

void BlobEraser::run(const std::stop_token& stop) {
  Lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, stop, [this]() ISOMESH_REQUIRES(mutex_) { return !waiting_.empty(); });
    if (stop.stop_requested()) return;
    changed_.wait_for(lock, stop, kPause,
                      [this]() ISOMESH_REQUIRES(mutex_) { return hurries_ > 0; });
    if (stop.stop_requested()) return;
    const std::string key = waiting_.front();
    lock.unlock();
    const bool is_done = erase_now(key);
    lock.lock();
    waiting_.pop_front();
    if (is_done && std::ranges::count(waiting_, key) == 0 && !coming_.contains(key)) {
      std::error_code ignored;  // the next start finds nothing to do
      std::filesystem::remove(marks_ / key, ignored);
    }
    changed_.notify_all();
  }
}

bool BlobEraser::erase_now(const std::string& key) {
  try {
    // Freeing the bytes of a large blob takes long. The store would hold a lock meanwhile.
    const std::shared_ptr<const void> held = blobs_.hold_bytes(key);
    const auto names = [this](const std::string& asked) { return volumes_.names(asked); };
    // Another daemon may have stored the same blob at any time and be about to name it, so every
    // blob counts as recent.
    blobs_.erase_unnamed(std::span(&key, 1), store::Steady(), names);
    return true;
  } catch (const std::exception& error) {
    log_error("a file of a deleted volume or job could not be erased and is removed later: {}",
              error.what());
    return false;
  }
}

}  // namespace isomesh::jobs
