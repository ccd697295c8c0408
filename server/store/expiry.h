// Types for the expiry of jobs and volumes.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace isomesh::store {

using Time = std::chrono::system_clock::time_point;

enum class RecordKind { kJob, kVolume };

// A finished job, or a volume that no queued or running job needs.
struct Expirable {
  RecordKind kind = RecordKind::kJob;
  std::string owner;
  std::string id;
  // For a job, the time of its end. For a volume, the time it was added or the end of the last job
  // on it, whichever is later.
  Time last_used;
};

struct ExpiryFilter {
  Time before;                            // last used earlier than this
  std::optional<std::string> owner = {};  // only this owner's
};

// Bytes of the blobs named by each owner's records; a blob counts once per owner.
using OwnedBytes = std::map<std::string, std::uint64_t>;

struct Expired {
  std::vector<Expirable> records = {};
  std::uint64_t bytes = 0;              // of the blobs that no record names any more
  std::vector<std::string> blobs = {};  // keys of those blobs
};

// Called with the keys of the blobs that the records to be erased name, before they are gone. A
// repeated transaction calls it again. May be empty.
using BlobsGoing = std::function<void(std::span<const std::string> keys)>;

// As `enough` of expire(): removes all given records.
inline constexpr std::uint64_t kAllBytes = std::numeric_limits<std::uint64_t>::max();

}  // namespace isomesh::store
