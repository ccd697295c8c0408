// S3BlobStore's erasing and sweeping of unnamed objects.
#include <algorithm>
#include <utility>

#include "base/log.h"
#include "proto/error.h"
#include "server/store/s3/blob_store.h"
#include "server/store/s3/objects.h"

namespace isomesh::store {
namespace {

constexpr std::chrono::hours kLongestObjectHold{24};
// Times of objects have whole seconds.
constexpr std::chrono::seconds kClockStep{1};

}  // namespace

void S3BlobStore::erase(const std::string& key) {
  const auto bytes = client_.size(blob_object(key));
  cache_.erase(key);
  if (!bytes) return;
  client_.erase(blob_object(key));
  room_.give(*bytes);
}

// A leftover hold expires.
void S3BlobStore::mark_named(const std::string& key) {
  const std::string hold = unnamed_.remove(key);
  if (!hold.empty()) client_.try_to_erase(hold);
}

bool S3BlobStore::is_held(const std::string& key, std::chrono::nanoseconds oldest) const {
  const S3Listing holds = client_.list(hold_objects(key));
  return std::ranges::any_of(holds.objects, [&](const S3Object& hold) {
    return holds.now - hold.modified <= oldest + kClockStep;
  });
}

std::vector<std::string> S3BlobStore::erase_unnamed(std::span<const std::string> keys,
                                                    Steady spare_since, const Names& names) {
  std::vector<std::string> left;
  for (const std::string& key : keys) {
    if (names(key)) continue;
    if (unnamed_.has_since(key, spare_since) || !take_out(key, spare_since, names)) {
      left.push_back(key);
    }
  }
  return left;
}

// Returns false if the blob is held or named.
bool S3BlobStore::take_out(const std::string& key, Steady spare_since, const Names& names) {
  const std::string going = going_object(key);
  client_.put_text(going, "");
  std::optional<std::uint64_t> bytes;
  try {
    if (is_held(key, age_of(spare_since)) || names(key)) {
      client_.erase(going);
      return false;
    }
    bytes = client_.size(blob_object(key));
  } catch (...) {
    client_.try_to_erase(going);
    throw;
  }
  const S3Client::Erased erased = client_.erase(blob_object(key));
  client_.erase(quarantine_object(key));
  // If a repeated request may still take effect later, the mark stays until it expires, so that
  // nobody stores the blob again before that.
  if (erased == S3Client::Erased::kAtOnce) client_.erase(going);
  cache_.erase(key);
  room_.give(bytes.value_or(0));
  return true;
}

bool S3BlobStore::is_time_to_sweep() {
  const Steady now = Steady::clock::now();
  const Lock lock(mutex_);
  if (now < next_sweep_) return false;
  next_sweep_ = now + options_.between_sweeps;
  return true;
}

Swept S3BlobStore::sweep(Steady spare_since, const Names& names) {
  if (!is_time_to_sweep()) return {};
  {
    const Lock lock(mutex_);
    spare_since_ = spare_since;
  }
  std::vector<std::string> keys;
  std::uint64_t bytes = 0;
  for (const S3Object& object : client_.list(kBlobObjects).objects) {
    keys.push_back(blob_of(object.key));
    bytes += object.bytes;
  }
  room_.recount(bytes);
  std::set<std::string> in_quarantine;
  for (const S3Object& object : client_.list(kQuarantineObjects).objects) {
    in_quarantine.insert(blob_of(object.key));
  }
  // Listed after the blobs, so every listed blob already had its hold.
  const std::set<std::string> held = tidy_holds(age_of(spare_since));
  tidy_going();
  const std::size_t most = most_swept(keys.size());
  Swept swept;
  for (const std::string& key : keys) {
    if (names(key)) {
      if (in_quarantine.contains(key)) client_.erase(quarantine_object(key));
      continue;
    }
    if (in_quarantine.contains(key) || held.contains(key)) continue;
    if (unnamed_.has_since(key, spare_since)) continue;
    if (swept.quarantined == most) {
      ++swept.left;
      continue;
    }
    client_.put_text(quarantine_object(key), "");
    ++swept.quarantined;
  }
  cache_.keep_only(names);
  unnamed_.forget(spare_since);
  return swept;
}

std::set<std::string> S3BlobStore::tidy_holds(std::chrono::nanoseconds oldest) {
  std::set<std::string> held;
  const S3Listing holds = client_.list(kHoldObjects);
  for (const S3Object& hold : holds.objects) {
    const auto age = holds.now - hold.modified;
    if (age <= oldest + kClockStep) held.insert(blob_of(hold.key));
    if (age > std::max<std::chrono::nanoseconds>(oldest, kLongestObjectHold)) {
      client_.erase(hold.key);
    }
  }
  return held;
}

void S3BlobStore::tidy_going() {
  const S3Listing going = client_.list(kGoingObjects);
  for (const S3Object& object : going.objects) {
    if (going.now - object.modified > kLongestGoing) client_.erase(object.key);
  }
}

std::size_t S3BlobStore::empty_quarantine(Time before, const Names& names) {
  const Steady spare_since = [&] {
    const Lock lock(mutex_);
    return spare_since_;
  }();
  std::size_t removed = 0;
  for (const S3Object& object : client_.list(kQuarantineObjects).objects) {
    if (object.modified >= before) continue;
    const std::string key = blob_of(object.key);
    if (names(key)) {
      client_.erase(object.key);
    } else if (take_out(key, spare_since, names)) {
      ++removed;
    }
  }
  return removed;
}

}  // namespace isomesh::store
