#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "base/mutex.h"
#include "server/store/blob_store.h"

namespace isomesh::store {

// The blobs that this process has stored and that no record names yet, each with its holds, which
// mark it for other daemons (empty names if there are none). Thread safe.
class UnnamedBlobs {
 public:
  void note(const std::string& key, std::string hold) {
    const Lock lock(mutex_);
    Stored& stored = blobs_[key];
    stored.holds.push_back(std::move(hold));
    stored.last = Steady::clock::now();
  }

  // Removes one hold of the blob and returns its name, so that the caller removes it from the
  // store.
  std::string remove(const std::string& key) {
    const Lock lock(mutex_);
    const auto found = blobs_.find(key);
    if (found == blobs_.end()) return {};
    std::string hold = std::move(found->second.holds.back());
    found->second.holds.pop_back();
    if (found->second.holds.empty()) blobs_.erase(found);
    return hold;
  }

  bool has_since(const std::string& key, Steady since) const {
    const Lock lock(mutex_);
    const auto found = blobs_.find(key);
    return found != blobs_.end() && found->second.last >= since;
  }

  // Removes blobs stored before that; they will not be named any more.
  void forget(Steady before) {
    const Lock lock(mutex_);
    std::erase_if(blobs_, [&](const auto& blob) { return blob.second.last < before; });
  }

 private:
  struct Stored {
    std::vector<std::string> holds;
    Steady last;
  };

  mutable Mutex mutex_;
  std::map<std::string, Stored> blobs_ ISOMESH_GUARDED_BY(mutex_);
};

// Time elapsed since then.
inline std::chrono::nanoseconds age_of(Steady time) { return Steady::clock::now() - time; }

}  // namespace isomesh::store
