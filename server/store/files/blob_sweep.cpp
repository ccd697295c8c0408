// FileBlobStore's erasing and sweeping of unnamed blobs.
#include <algorithm>
#include <vector>

#include <sys/stat.h>

#include "proto/error.h"
#include "server/store/files/blob_store.h"

namespace isomesh::store {
namespace {

// Age at which files of dead daemons in a shared folder are removed.
constexpr std::chrono::hours kLongestHold{24};
constexpr std::chrono::hours kLongestDraft{48};

}  // namespace

std::shared_ptr<const void> FileBlobStore::hold_bytes(const std::string& key) const {
  try {
    return std::make_shared<File>(File::open(found(key)));
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kNotFound) return nullptr;
    throw;
  }
}

// A sweep that has just found no name still finds the blob recent.
void FileBlobStore::mark_named(const std::string& key) {
  const Lock lock(places_);
  const std::string hold = unnamed_.remove(key);
  if (!hold.empty()) holds_->let_go(hold);
}

std::set<std::string> FileBlobStore::held(std::chrono::nanoseconds oldest) const {
  if (!holds_) return {};
  try {
    return holds_->held(oldest);
  } catch (const Error&) {
    check_is_there();
    throw;
  }
}

std::vector<std::string> FileBlobStore::erase_unnamed(std::span<const std::string> keys,
                                                      Steady spare_since, const Names& names) {
  std::vector<std::string> left;
  for (const std::string& key : keys) {
    const Lock lock(places_);
    if (names(key)) continue;
    if (unnamed_.has_since(key, spare_since)) {
      left.push_back(key);
    } else if (!holds_) {
      erase(key);
    } else if (!take_out(key, age_of(spare_since), names)) {
      left.push_back(key);
    }
  }
  return left;
}

bool FileBlobStore::take_out(const std::string& key, std::chrono::nanoseconds oldest_hold,
                             const Names& names) {
  if (held(oldest_hold).contains(key)) return false;
  found(key);
  if (!put_aside(key)) return true;
  if (look_again(std::span(&key, 1), oldest_hold, names) > 0) return false;
  const std::filesystem::path aside = folders_.quarantine / key;
  const std::uint64_t bytes = size_of(aside);
  std::error_code gone;  // it was requested and brought back
  if (std::filesystem::remove(aside, gone)) room_.give(bytes);
  return true;
}

bool FileBlobStore::put_aside(const std::string& key) {
  touch(place_of(key));  // records when it entered the quarantine
  try {
    move_to(place_of(key), folders_.quarantine / key);
  } catch (const Error& error) {
    // Another daemon on this folder was faster.
    if (!holds_ || error.code() != ErrorCode::kNotFound) throw;
    check_is_there();
    return false;
  }
  return true;
}

std::size_t FileBlobStore::look_again(std::span<const std::string> keys,
                                      std::chrono::nanoseconds oldest_hold, const Names& names) {
  if (!holds_ || keys.empty()) return 0;
  const std::set<std::string> held_now = held(oldest_hold);
  std::size_t back = 0;
  for (const std::string& key : keys) {
    if (!held_now.contains(key) && !names(key)) continue;
    std::error_code absent;  // it was requested and is already back
    std::filesystem::rename(folders_.quarantine / key, place_of(key), absent);
    ++back;
  }
  return back;
}

Swept FileBlobStore::sweep(Steady spare_since, const Names& names) {
  std::vector<std::string> keys = this->keys();
  const std::size_t most = most_swept(keys.size());
  std::erase_if(keys, names);
  const std::set<std::string> held_by_others = held(age_of(spare_since));
  Swept swept;
  std::vector<std::string> aside;
  for (const std::string& key : keys) {
    const Lock lock(places_);
    if (unnamed_.has_since(key, spare_since) || names(key)) continue;
    if (held_by_others.contains(key)) continue;
    if (aside.size() == most) {
      ++swept.left;
      continue;
    }
    if (put_aside(key)) aside.push_back(key);
  }
  swept.quarantined = aside.size() - look_again(aside, age_of(spare_since), names);
  if (holds_) tidy_shared(age_of(spare_since));
  unnamed_.forget(spare_since);
  return swept;
}

void FileBlobStore::tidy_shared(std::chrono::nanoseconds oldest_hold) {
  holds_->forget(std::max<std::chrono::nanoseconds>(oldest_hold, kLongestHold));
  std::error_code gone;
  const auto cutoff = std::filesystem::file_time_type::clock::now() - kLongestDraft;
  for (const auto& entry : std::filesystem::directory_iterator(folders_.drafts, gone)) {
    const auto written = entry.last_write_time(gone);
    if (!gone && written < cutoff) std::filesystem::remove_all(entry.path(), gone);
  }
  room_.recount(counted_bytes());
}

std::size_t FileBlobStore::empty_quarantine(Time before, const Names& names) {
  std::size_t removed = 0;
  std::error_code gone;  // requested blobs are brought back meanwhile
  for (const auto& entry : std::filesystem::directory_iterator(folders_.quarantine, gone)) {
    struct stat status = {};
    if (::stat(entry.path().c_str(), &status) != 0) continue;
    const auto since = std::chrono::seconds(status.st_mtim.tv_sec);
    if (since >= before.time_since_epoch()) continue;
    const Lock lock(places_);
    if (names(entry.path().filename())) {
      std::filesystem::rename(entry.path(), place_of(entry.path().filename()), gone);
      continue;
    }
    if (!std::filesystem::remove(entry.path(), gone)) continue;
    room_.give(static_cast<std::uint64_t>(status.st_size));
    ++removed;
  }
  return removed;
}

// Only files at a blob's place; the folder has other files too.
std::vector<std::string> FileBlobStore::keys() const {
  std::vector<std::string> keys;
  std::error_code gone;  // files come and go meanwhile
  std::filesystem::recursive_directory_iterator entry(folders_.blobs, gone);
  for (; entry != std::filesystem::recursive_directory_iterator(); entry.increment(gone)) {
    const std::string key = entry->path().filename();
    if (entry->is_regular_file(gone) && place_of(key) == entry->path()) keys.push_back(key);
  }
  return keys;
}

}  // namespace isomesh::store
