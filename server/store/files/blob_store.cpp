#include "server/store/files/blob_store.h"

#include <algorithm>
#include <array>
#include <vector>

#include <fcntl.h>
#include <sys/stat.h>
#include <time.h>

#include "base/hex.h"
#include "base/ids.h"
#include "base/sha256.h"
#include "proto/error.h"
#include "server/store/files/files.h"

namespace isomesh::store {
namespace {

// Folders of many thousand files are slow to list; the first byte of the key splits them.
constexpr std::size_t kPrefix = 2;
constexpr std::size_t kBlockBytes = std::size_t{1} << 20;
constexpr std::chrono::hours kBelieved{1};
constexpr std::chrono::minutes kBetweenForgetting{5};
// Of all blobs, what one sweep may take: a tenth, but a few always.
constexpr std::size_t kSweptShare = 10;
constexpr std::size_t kSweptAtLeast = 16;

// What changes when somebody writes to a file or puts another in its place; empty without a file.
std::string traits_of(const std::filesystem::path& file) {
  struct stat status = {};
  if (::stat(file.c_str(), &status) != 0) return {};
  std::string text;
  for (const auto part :
       {static_cast<std::int64_t>(status.st_dev), static_cast<std::int64_t>(status.st_ino),
        static_cast<std::int64_t>(status.st_size), static_cast<std::int64_t>(status.st_mtim.tv_sec),
        static_cast<std::int64_t>(status.st_mtim.tv_nsec),
        static_cast<std::int64_t>(status.st_ctim.tv_sec),
        static_cast<std::int64_t>(status.st_ctim.tv_nsec)}) {
    text += std::to_string(part) + ' ';
  }
  return text;
}

// The digest of all bytes, which passes in blocks.
Blob digest_of(const File& file, const std::stop_token& stop) {
  Sha256 digest;
  std::vector<std::byte> block(kBlockBytes);
  std::uint64_t offset = 0;
  while (const std::size_t count = file.read_at(offset, block)) {
    if (stop.stop_requested()) throw Error(ErrorCode::kCancelled, "cancelled");
    digest.update(std::span(block).first(count));
    offset += count;
  }
  return {to_hex(digest.finish()), offset};
}

// 0 when it is not there.
std::uint64_t size_of(const std::filesystem::path& file) {
  std::error_code absent;
  const std::uintmax_t bytes = std::filesystem::file_size(file, absent);
  return absent ? 0 : bytes;
}

void touch(const std::filesystem::path& file) {
  timespec now = {};
  ::clock_gettime(CLOCK_REALTIME, &now);
  const std::array<timespec, 2> times = {now, now};
  ::utimensat(AT_FDCWD, file.c_str(), times.data(), 0);
}

class FileReader : public BlobReader {
 public:
  explicit FileReader(File file) : file_(std::move(file)) {}

  std::uint64_t size() const override { return file_.size(); }
  std::size_t read_at(std::uint64_t offset, std::span<std::byte> bytes) const override {
    return file_.read_at(offset, bytes);
  }

 private:
  File file_;
};

}  // namespace

class FileBlobStore::Writer : public BlobWriter {
 public:
  explicit Writer(const FileBlobStore& store)
      : store_(store),
        path_(store.folder_.scratch() / (random_hex(8) + ".blob")),
        file_(File::create(path_)) {}

  ~Writer() override {
    std::error_code ignored;  // a blob that was committed is no longer here
    std::filesystem::remove(path_, ignored);
    store_.room_.give(taken_);
  }

  void write(std::span<const std::byte> bytes) override {
    bytes_ += bytes.size();
    if (bytes_ > store_.capacity()) {
      throw Error(ErrorCode::kTooLarge, "the file takes more than all the room that there is");
    }
    store_.folder_.reserve().check_room();  // which is there to free more, not to be filled
    store_.room_.take(bytes.size());
    taken_ += bytes.size();
    file_.write(bytes);
    digest_.update(bytes);
  }

  Blob commit() override {
    const std::string key = to_hex(digest_.finish());
    store_.believe(key, store_.publish_as(path_, file_, key, bytes_));
    taken_ = 0;
    return {key, bytes_};
  }

 private:
  const FileBlobStore& store_;
  std::filesystem::path path_;
  File file_;
  Sha256 digest_;
  std::uint64_t bytes_ = 0;
  std::uint64_t taken_ = 0;  // of the room, until it is a blob
};

// Has others that ask for the same blob wait.
class FileBlobStore::CheckUnderWay {
 public:
  CheckUnderWay(const FileBlobStore& store, const std::string& key) : store_(store), key_(key) {}
  ~CheckUnderWay() {
    const Lock lock(store_.intact_mutex_);
    store_.under_check_.erase(key_);
    store_.checked_.notify_all();
  }
  CheckUnderWay(const CheckUnderWay&) = delete;
  CheckUnderWay& operator=(const CheckUnderWay&) = delete;

 private:
  const FileBlobStore& store_;
  const std::string& key_;
};

Blob digest_of(const std::filesystem::path& path) {
  const File file = File::open(path);
  file.begin_sync();
  return digest_of(file, {});
}

FileBlobStore::FileBlobStore(const DataFolder& folder) : folder_(folder) {
  for (const std::string& key : all_keys()) room_.take(size_of(path_of(key)));
  for (const auto& entry : std::filesystem::directory_iterator(folder_.quarantine())) {
    room_.take(size_of(entry.path()));
  }
}

std::uint64_t FileBlobStore::capacity() const {
  const std::uint64_t disk = folder_.reserve().capacity();
  return room_.max_bytes() == 0 ? disk : std::min(disk, room_.max_bytes());
}

std::unique_ptr<BlobWriter> FileBlobStore::begin() const { return std::make_unique<Writer>(*this); }

void FileBlobStore::adopt(const std::filesystem::path& file, const Blob& blob) const {
  folder_.reserve().check_room();
  // One that is there already makes place for this one.
  const std::uint64_t more = blob.bytes - std::min(blob.bytes, size(blob.key).value_or(0));
  room_.take(more);
  try {
    believe(blob.key, publish_as(file, File::open(file), blob.key, more));
  } catch (...) {
    room_.give(more);
    throw;
  }
}

std::unique_ptr<BlobReader> FileBlobStore::open(const std::string& key) const {
  return std::make_unique<FileReader>(File::open(found(key)));
}

LocalBlob FileBlobStore::local(const std::string& key) const {
  if (!size(key)) throw Error(ErrorCode::kNotFound, "the file is not there");
  return {found(key)};
}

bool is_there_and_intact(const BlobStore& blobs, const std::string& key,
                         const std::stop_token& stop) {
  try {
    return blobs.is_intact(key, stop);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kNotFound) return false;
    throw;
  }
}

bool FileBlobStore::is_intact(const std::string& key, const std::stop_token& stop) const {
  const std::filesystem::path place = found(key);
  const std::string traits = traits_of(place);
  {
    Lock lock(intact_mutex_);
    checked_.wait(lock,
                  [&]() ISOMESH_REQUIRES(intact_mutex_) { return !under_check_.contains(key); });
    const auto known = intact_.find(key);
    if (known != intact_.end() && known->second.traits == traits &&
        Steady::clock::now() - known->second.when < kBelieved) {
      return true;
    }
    under_check_.insert(key);
  }
  const CheckUnderWay check(*this, key);
  const bool is_intact = digest_of(File::open(place), stop).key == key;
  if (is_intact) believe(key, traits);
  return is_intact;
}

void FileBlobStore::believe(const std::string& key, const std::string& traits) const {
  const auto now = std::chrono::steady_clock::now();
  const Lock lock(intact_mutex_);
  if (now >= next_forgetting_) {  // not at every blob: there may be a million
    std::erase_if(intact_, [&](const auto& entry) { return now - entry.second.when >= kBelieved; });
    next_forgetting_ = now + kBetweenForgetting;
  }
  intact_[key] = {traits, now};
}

std::optional<std::uint64_t> FileBlobStore::size(const std::string& key) const {
  std::error_code absent;
  const std::uintmax_t bytes = std::filesystem::file_size(found(key), absent);
  if (absent) return std::nullopt;
  return bytes;
}

void FileBlobStore::erase(const std::string& key) const {
  const std::uint64_t bytes = size_of(path_of(key));
  std::error_code ignored;
  if (std::filesystem::remove(path_of(key), ignored)) room_.give(bytes);
}

std::filesystem::path FileBlobStore::found(const std::string& key) const {
  const std::filesystem::path place = path_of(key);
  if (std::filesystem::exists(place)) return place;
  std::error_code absent;
  std::filesystem::rename(folder_.quarantine() / key, place, absent);
  return place;
}

std::filesystem::path FileBlobStore::path_of(const std::string& key) const {
  return folder_.blobs() / key.substr(0, kPrefix) / key;
}

void FileBlobStore::settle(const std::string& key) const {
  const Lock lock(places_);
  const auto stored = unsettled_.find(key);
  if (stored != unsettled_.end() && --stored->second.times == 0) unsettled_.erase(stored);
}

bool FileBlobStore::is_unsettled(const std::string& key, Steady since) const {
  const auto stored = unsettled_.find(key);
  return stored != unsettled_.end() && stored->second.last >= since;
}

std::vector<std::string> FileBlobStore::erase_unnamed(std::span<const std::string> keys,
                                                      Steady unsettled, const Names& names) const {
  std::vector<std::string> left;
  for (const std::string& key : keys) {
    const Lock lock(places_);
    if (names(key)) continue;
    if (is_unsettled(key, unsettled)) {
      left.push_back(key);
    } else {
      erase(key);
    }
  }
  return left;
}

Swept FileBlobStore::sweep(Steady unsettled, const Names& names) const {
  std::vector<std::string> keys = all_keys();
  const std::size_t most = std::max(kSweptAtLeast, keys.size() / kSweptShare);
  std::erase_if(keys, names);
  Swept swept;
  for (const std::string& key : keys) {
    const Lock lock(places_);
    if (is_unsettled(key, unsettled) || names(key)) continue;
    if (swept.quarantined == most) {
      ++swept.left;
      continue;
    }
    touch(path_of(key));  // when it came there
    move_to(path_of(key), folder_.quarantine() / key);
    ++swept.quarantined;
  }
  const Lock lock(places_);
  std::erase_if(unsettled_, [&](const auto& stored) { return stored.second.last < unsettled; });
  return swept;
}

std::size_t FileBlobStore::empty_quarantine(Time before) const {
  std::size_t removed = 0;
  std::error_code gone;  // one that is asked for is put back while we look
  for (const auto& entry : std::filesystem::directory_iterator(folder_.quarantine(), gone)) {
    struct stat status = {};
    if (::stat(entry.path().c_str(), &status) != 0) continue;
    const auto since = std::chrono::seconds(status.st_mtim.tv_sec);
    if (since >= before.time_since_epoch()) continue;
    if (!std::filesystem::remove(entry.path(), gone)) continue;
    room_.give(static_cast<std::uint64_t>(status.st_size));
    ++removed;
  }
  return removed;
}

// Only what has a blob's place: the folder has other files too.
std::vector<std::string> FileBlobStore::all_keys() const {
  std::vector<std::string> keys;
  std::error_code gone;  // files come and go while we look
  std::filesystem::recursive_directory_iterator entry(folder_.blobs(), gone);
  for (; entry != std::filesystem::recursive_directory_iterator(); entry.increment(gone)) {
    const std::string key = entry->path().filename();
    if (entry->is_regular_file(gone) && path_of(key) == entry->path()) keys.push_back(key);
  }
  return keys;
}

std::string FileBlobStore::publish_as(const std::filesystem::path& path, const File& file,
                                      const std::string& key, std::uint64_t taken) const {
  // The time is a finer one than the system gives to files that are written, so a write within the
  // same tick changes it.
  touch(path);
  const std::filesystem::path place = path_of(key);
  make_folder_for(place);
  const std::uint64_t bytes = size_of(path);
  std::string traits;
  const auto stored = [&](std::uint64_t replaced) ISOMESH_REQUIRES(places_) {
    room_.settle(taken + replaced, bytes);
    note_unsettled(key);
    traits = traits_of(place);
  };
  // Where nothing is there, no record that survives can name the place before both are synced. The
  // file's sync then brings its name to disk too on most file systems, and the folder's finds
  // nothing to do. What is there may be named already and must not be lost in between.
  bool has_moved = false;
  {
    const Lock lock(places_);
    has_moved = move_to_free_place(path, place);
    if (has_moved) stored(0);
  }
  try {
    file.sync();
  } catch (...) {
    // It stays counted until it is swept, and whoever took the bytes gives them back.
    if (has_moved) room_.settle(0, taken);
    throw;
  }
  if (!has_moved) {
    const Lock lock(places_);
    const std::uint64_t replaced = size_of(place);
    move_to(path, place);
    stored(replaced);
  }
  sync_folder(place.parent_path());
  return traits;
}

void FileBlobStore::note_unsettled(const std::string& key) const {
  Unsettled& stored = unsettled_[key];
  stored.times += 1;
  stored.last = std::chrono::steady_clock::now();
}

// A folder that is there is not yet on the disk when another thread has just made it, or when the
// process that made it was killed. So all are synced once by this process, whoever made them.
void FileBlobStore::make_folder_for(const std::filesystem::path& place) const {
  const Lock lock(folders_mutex_);
  std::error_code error;
  if (!has_folders_) {
    constexpr int kFolders = 256;
    for (int first = 0; first < kFolders; ++first) {
      const auto byte = static_cast<std::uint8_t>(first);
      std::filesystem::create_directory(folder_.blobs() / to_hex(std::span(&byte, 1)), error);
    }
    sync_folder(folder_.blobs());
    has_folders_ = true;
  }
  const bool is_new = std::filesystem::create_directory(place.parent_path(), error);
  if (error == std::errc::no_space_on_device) {
    throw Error(ErrorCode::kOutOfSpace, "the data folder has no space left");
  }
  if (is_new) sync_folder(folder_.blobs());
}

}  // namespace isomesh::store
