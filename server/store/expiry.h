// What retention removes from the stores of jobs and of volumes.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace isomesh::store {

using Time = std::chrono::system_clock::time_point;

enum class RecordKind { kJob, kVolume };

// A job that has ended, or a volume that no queued or running job needs.
struct Expirable {
  RecordKind kind = RecordKind::kJob;
  std::string owner;
  std::string id;
  // When the job ended; when the volume was added or the last job on it ended, whichever is later.
  Time last_used;
};

// Which of those to list.
struct ExpiryFilter {
  Time before;                            // last used earlier
  std::optional<std::string> owner = {};  // of this one alone
};

// Bytes of the blobs that each owner's records name, each counted once for an owner.
using OwnedBytes = std::map<std::string, std::uint64_t>;

// What a call of expire() removed.
struct Expired {
  std::vector<Expirable> records = {};
  std::uint64_t bytes = 0;              // of the blobs that no record names any more
  std::vector<std::string> blobs = {};  // those
};

// As the bytes that are enough: all records that are given expire.
inline constexpr std::uint64_t kAllBytes = std::numeric_limits<std::uint64_t>::max();

}  // namespace isomesh::store
