#include "server/store/s3/blob_cache.h"

#include <algorithm>
#include <vector>

#include "base/log.h"
#include "proto/error.h"

namespace isomesh::store {

BlobCache::BlobCache(const BlobFolders& folders, Reserve& reserve, std::uint64_t most_bytes)
    : files_(folders, reserve), most_bytes_(most_bytes) {
  for (const std::string& key : files_.keys()) note(key, files_.size(key).value_or(0));
  make_room(0);
}

std::shared_ptr<const void> BlobCache::use(const std::string& key) {
  const Lock lock(mutex_);
  Copy& copy = copies_[key];
  ++copy.uses;
  copy.last_use = ++uses_;
  return {this, [this, key](const void* /*cache*/) { let_go(key); }};
}

void BlobCache::let_go(const std::string& key) {
  const Lock lock(mutex_);
  const auto found = copies_.find(key);
  if (--found->second.uses > 0) return;
  if (found->second.bytes == 0) {
    copies_.erase(found);
  } else {
    shrink_to(most_bytes_, key);  // a client that requested it often requests it again
  }
}

void BlobCache::note(const std::string& key, std::uint64_t bytes) {
  const Lock lock(mutex_);
  Copy& copy = copies_[key];
  bytes_ += bytes - copy.bytes;
  copy.bytes = bytes;
}

void BlobCache::erase(const std::string& key) {
  const Lock lock(mutex_);
  const auto found = copies_.find(key);
  if (found == copies_.end()) return;
  remove(key, found->second);
  if (found->second.uses == 0) copies_.erase(found);
}

// Throws nothing, because the end of a copy's use may come here. The next start finds what is left.
void BlobCache::remove(const std::string& key, Copy& copy) {
  try {
    files_.erase(key);
  } catch (const Error& error) {
    log_warning("a copy in the cache could not be removed: {}", error.what());
  }
  bytes_ -= copy.bytes;
  copy.bytes = 0;
}

void BlobCache::make_room(std::uint64_t bytes) {
  const Lock lock(mutex_);
  shrink_to(most_bytes_ - std::min(most_bytes_, bytes));
}

void BlobCache::empty() {
  const Lock lock(mutex_);
  shrink_to(0);
}

void BlobCache::shrink_to(std::uint64_t most_bytes, const std::string& but_for) {
  if (bytes_ <= most_bytes) return;
  std::vector<std::pair<std::uint64_t, std::string>> idle;
  for (const auto& [key, copy] : copies_) {
    if (copy.uses == 0 && key != but_for) idle.emplace_back(copy.last_use, key);
  }
  std::ranges::sort(idle);
  for (const auto& [last_use, key] : idle) {
    if (bytes_ <= most_bytes) return;
    const auto found = copies_.find(key);
    remove(key, found->second);
    copies_.erase(found);
  }
}

void BlobCache::keep_only(const std::function<bool(const std::string& key)>& stays) {
  std::vector<std::string> keys;
  {
    const Lock lock(mutex_);
    for (const auto& [key, copy] : copies_) keys.push_back(key);
  }
  std::erase_if(keys, stays);
  const Lock lock(mutex_);
  for (const std::string& key : keys) {
    const auto found = copies_.find(key);
    if (found == copies_.end() || found->second.uses > 0) continue;
    remove(key, found->second);
    copies_.erase(found);
  }
}

}  // namespace isomesh::store
