#include "server/store/files/blob_store.h"

#include <algorithm>
#include <limits>
#include <vector>

#include <sys/stat.h>

#include "base/files.h"
#include "base/held_folder.h"
#include "base/hex.h"
#include "base/ids.h"
#include "base/log.h"
#include "base/sha256.h"
#include "proto/error.h"
#include "server/store/file.h"

namespace isomesh::store {
namespace {

// Folders with many thousand files are slow to list, so the first byte of the key selects a folder.
constexpr std::size_t kPrefix = 2;
constexpr std::chrono::hours kBelieved{1};
constexpr std::chrono::minutes kBetweenForgetting{5};
constexpr const char* kMark = "identity";
// Free space required in a shared folder.
constexpr std::uint64_t kLeastShared = std::uint64_t{64} << 20;

// The database's name. SQLite's engine appends a number that grows.
std::string name_in(const std::string& mark) { return mark.substr(0, mark.find_first_of(" \n")); }

// A file's properties that change if it is written to or replaced; empty if it is missing.
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

// SHA-256 of a file, read block by block.
Blob digest_of(const File& file, const std::stop_token& stop) {
  Sha256 digest;
  const std::uint64_t bytes = file.read([&](std::span<const std::byte> block) {
    if (stop.stop_requested()) throw Error(ErrorCode::kCancelled, "cancelled");
    digest.update(block);
  });
  return {to_hex(digest.finish()), bytes};
}

}  // namespace

bool FileBlobStore::is_there() const {
  if (folders_.data != nullptr) return folders_.data->is_there();
  const std::string name = [&] {
    const Lock lock(mark_mutex_);
    return name_;
  }();
  std::error_code missing;
  bool is = std::filesystem::is_directory(folders_.blobs, missing);
  try {
    is = is && (name.empty() || name_in(read_whole(folders_.blobs / kMark)) == name);
  } catch (const Error& error) {
    is = error.code() == ErrorCode::kUnavailable;  // no descriptors: that says nothing about it
  }
  const bool was_missing = is_missing_.exchange(!is);
  if (!is && !was_missing) {
    log_error(
        "the storage of volumes and meshes is missing: the folder of --blobs is not there, or it "
        "belongs to another database. Is it mounted? Jobs wait until it is back");
  }
  if (is && was_missing) log_info("the storage of volumes and meshes is back");
  return is;
}

void FileBlobStore::check_is_there() const {
  if (!is_there()) throw missing_folder();
}

bool FileBlobStore::works() const {
  if (folders_.data != nullptr) return folders_.data->works();
  return is_there() && can_write_in(folders_.holds);
}

template <class Read>
auto FileBlobStore::read_in_folder(const Read& read) const {
  if (!holds_) check_is_there();  // a shared folder's mark takes long to read
  try {
    return read();
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kInternal) {
      if (!works()) throw missing_folder();
    } else if (error.code() == ErrorCode::kNotFound) {
      check_is_there();  // works() would write, each time that a cache lacks a copy
    } else {
      throw;
    }
  }
  return read();
}

template <class Write>
auto FileBlobStore::write_in_folder(const Write& write) const {
  try {
    return write();
  } catch (const Error& error) {
    const bool is_missing = error.code() == ErrorCode::kNotFound;
    if (!is_missing && error.code() != ErrorCode::kInternal) throw;
    if (is_missing) check_is_there();
    if (!is_missing && !works()) throw missing_folder();
    if (!holds_ || !is_missing) throw;
  }
  throw Error(ErrorCode::kUnavailable,
              "the storage of volumes and meshes was missing for a moment: try again");
}

class FileBlobStore::Writer : public BlobWriter {
 public:
  Writer(FileBlobStore& store, std::string owner)
      : store_(store),
        owner_(std::move(owner)),
        path_(store.folders_.drafts / (random_hex(8) + ".blob")),
        file_(store.write_in_folder([&] { return File::create(path_); })) {}

  ~Writer() override {
    std::error_code ignored;  // a committed blob has moved away
    std::filesystem::remove(path_, ignored);
    if (!is_committed_) store_.room_.give(taken_);
    store_.room_.finish(taken_, owner_);
  }

  void write(std::span<const std::byte> bytes) override {
    bytes_ += bytes.size();
    if (bytes_ > store_.capacity()) {
      throw Error(ErrorCode::kTooLarge, "the file is larger than all available space");
    }
    store_.reserve_.check_room();  // the reserve must not be used for new blobs
    store_.room_.take(bytes.size(), owner_);
    taken_ += bytes.size();
    store_.write_in_folder([&] { file_.write(bytes); });
    digest_.update(bytes);
  }

  Blob store(const std::stop_token& /*stop*/) override {
    const std::string key = to_hex(digest_.finish());
    // Another folder may be in the place of this one, where nothing would be found again.
    store_.check_is_there();
    store_.believe(
        key, store_.write_in_folder([&] { return store_.publish_as(path_, file_, key, bytes_); }));
    is_committed_ = true;
    return {key, bytes_};
  }

 private:
  FileBlobStore& store_;
  const std::string owner_;
  std::filesystem::path path_;
  File file_;
  Sha256 digest_;
  std::uint64_t bytes_ = 0;
  std::uint64_t taken_ = 0;  // from the room
  bool is_committed_ = false;
};

Blob digest_of(const std::filesystem::path& path) {
  const File file = File::open(path);
  file.begin_sync();
  return digest_of(file, {});
}

FileBlobStore::FileBlobStore(BlobFolders folders, Reserve& reserve)
    : folders_(std::move(folders)),
      reserve_(reserve),
      holds_(folders_.holds.empty() ? std::nullopt : std::optional(FolderHolds(folders_.holds))) {
  room_.recount(counted_bytes());
}

std::uint64_t FileBlobStore::counted_bytes() const {
  std::uint64_t bytes = 0;
  for (const std::string& key : keys()) bytes += size_of(place_of(key));
  for (const auto& entry : std::filesystem::directory_iterator(folders_.quarantine)) {
    bytes += size_of(entry.path());
  }
  return bytes;
}

bool FileBlobStore::responds() const {
  if (!holds_ && !is_there()) return false;
  return health_.passes([this] { return works(); });
}

bool FileBlobStore::is_empty() const {
  std::error_code gone;
  for (const auto& entry : std::filesystem::directory_iterator(folders_.blobs)) {
    if (entry.is_directory(gone) && !std::filesystem::is_empty(entry.path(), gone)) return false;
  }
  return true;
}

std::string FileBlobStore::mark() const {
  const std::filesystem::path place = folders_.blobs / kMark;
  std::string text = std::filesystem::exists(place) ? read_whole(place) : "";
  const Lock lock(mark_mutex_);
  if (name_.empty()) name_ = name_in(text);
  return text;
}

void FileBlobStore::set_mark(const std::string& text) {
  check_is_there();
  const ScratchFolder scratch(folders_.drafts);
  const std::filesystem::path draft = scratch.path() / kMark;
  {
    File file = File::create(draft);
    file.write(std::as_bytes(std::span(text)));
    file.sync();
  }
  move_to(draft, folders_.blobs / kMark);
  sync_folder(folders_.blobs);
  const Lock lock(mark_mutex_);
  name_ = name_in(text);
}

bool FileBlobStore::has_room() const {
  if (!reserve_.has_room()) return false;
  if (!holds_) return true;
  std::error_code unknown;  // writing reports the error
  const auto space = std::filesystem::space(folders_.blobs, unknown);
  return unknown || space.available > kLeastShared;
}

std::uint64_t FileBlobStore::disk_capacity() const {
  if (!holds_) return reserve_.capacity();
  std::error_code unknown;
  const auto space = std::filesystem::space(folders_.blobs, unknown);
  return unknown ? std::numeric_limits<std::uint64_t>::max() : space.capacity;
}

std::unique_ptr<BlobWriter> FileBlobStore::begin(const std::string& owner) {
  check_is_there();
  return std::make_unique<Writer>(*this, owner);
}

void FileBlobStore::adopt(const std::filesystem::path& file, const Blob& blob,
                          const std::string& owner, const std::stop_token& stop) {
  if (holds_) {
    copy_in(file, blob, owner, stop);
    return;
  }
  check_is_there();
  reserve_.check_room();
  // An existing blob is replaced, so only the difference takes room.
  const std::uint64_t more = blob.bytes - std::min(blob.bytes, size(blob.key).value_or(0));
  room_.take(more, owner);
  try {
    believe(blob.key,
            write_in_folder([&] { return publish_as(file, File::open(file), blob.key, more); }));
  } catch (...) {
    room_.finish(more, owner);
    room_.give(more);
    throw;
  }
  room_.finish(more, owner);
}

// A shared folder is on another file system, so the file cannot be moved.
void FileBlobStore::copy_in(const std::filesystem::path& file, const Blob& blob,
                            const std::string& owner, const std::stop_token& stop) {
  const File source = File::open(file);
  const std::unique_ptr<BlobWriter> writer = begin(owner);
  source.read([&](std::span<const std::byte> block) {
    if (stop.stop_requested()) throw Error(ErrorCode::kCancelled, "cancelled");
    writer->write(block);
  });
  if (writer->commit().key != blob.key) {
    throw Error(ErrorCode::kInternal, "a file changed while it was copied");
  }
  std::filesystem::remove(file);
}

std::unique_ptr<BlobReader> FileBlobStore::open(const std::string& key) const {
  return read_in_folder([&] { return std::make_unique<File>(File::open(found(key))); });
}

LocalBlob FileBlobStore::local(const std::string& key) const {
  if (!size(key)) throw Error(ErrorCode::kNotFound, "the file does not exist");
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
  const std::filesystem::path place = read_in_folder([&] { return found(key); });
  const std::string traits = traits_of(place);
  const KeyedTurns::Turn turn(checks_, key, stop);
  if (is_believed(key, traits)) return true;
  const File file = read_in_folder([&] { return File::open(found(key)); });
  const bool is_intact = digest_of(file, stop).key == key;
  // Without properties, the shared folder was missing a moment ago.
  if (is_intact && !traits.empty()) believe(key, traits);
  return is_intact;
}

bool FileBlobStore::is_believed(const std::string& key, const std::string& traits) const {
  const Lock lock(intact_mutex_);
  const auto known = intact_.find(key);
  return known != intact_.end() && known->second.traits == traits &&
         Steady::clock::now() - known->second.when < kBelieved;
}

void FileBlobStore::believe(const std::string& key, const std::string& traits) const {
  const auto now = std::chrono::steady_clock::now();
  const Lock lock(intact_mutex_);
  if (now >= next_forgetting_) {  // not on each call: there may be a million blobs
    std::erase_if(intact_, [&](const auto& entry) { return now - entry.second.when >= kBelieved; });
    next_forgetting_ = now + kBetweenForgetting;
  }
  intact_[key] = {traits, now};
}

std::optional<std::uint64_t> FileBlobStore::size(const std::string& key) const {
  const auto bytes = read_in_folder([&] { return size_now(key); });
  if (bytes || !holds_) return bytes;
  check_is_there();
  return size_now(key);
}

std::optional<std::uint64_t> FileBlobStore::size_now(const std::string& key) const {
  std::error_code absent;
  const std::uintmax_t bytes = std::filesystem::file_size(found(key), absent);
  if (absent) return std::nullopt;
  return bytes;
}

void FileBlobStore::erase(const std::string& key) {
  const std::filesystem::path place = found(key);
  const std::uint64_t bytes = size_of(place);
  std::error_code error;
  if (std::filesystem::remove(place, error)) {
    room_.give(bytes);
    return;
  }
  if (holds_) check_is_there();
  if (error) throw_system_error("erasing a file", error.value());
}

std::filesystem::path FileBlobStore::found(const std::string& key) const {
  const std::filesystem::path place = place_of(key);
  std::error_code error;
  if (std::filesystem::exists(place, error)) return place;
  if (error) throw_system_error("finding a file", error.value());
  std::error_code absent;
  std::filesystem::rename(folders_.quarantine / key, place, absent);
  return place;
}

std::filesystem::path FileBlobStore::path_of(const std::string& key) const {
  return for_other_process(place_of(key));
}

std::filesystem::path FileBlobStore::place_of(const std::string& key) const {
  return folders_.blobs / key.substr(0, kPrefix) / key;
}

std::string FileBlobStore::publish_as(const std::filesystem::path& path, const File& file,
                                      const std::string& key, std::uint64_t taken) {
  // The times of written files are coarse. An exact time makes any later write within the same tick
  // change it.
  touch(path);
  const std::filesystem::path place = place_of(key);
  make_folder_for(place);
  const std::uint64_t bytes = size_of(path);
  const std::string hold = holds_ ? holds_->hold(key) : "";
  std::string traits;
  const auto stored = [&](std::uint64_t replaced) {
    room_.correct(taken + replaced, bytes);
    unnamed_.note(key, hold);
    traits = traits_of(place);
  };
  // If the place is free, no surviving record can name the blob before both syncs. On most file
  // systems the file's sync also persists its name, so the folder's sync is free. If the place is
  // taken, a record may name that file already, so it must survive a crash at any moment: the new
  // file is synced before it replaces the old one.
  bool has_moved = false;
  {
    const Lock lock(places_);
    has_moved = move_to_free_place(path, place);
    if (has_moved) stored(0);
  }
  try {
    if (folders_.outlive_crashes) file.sync();
  } catch (...) {
    // The file counts until it is swept; the caller gives back the bytes that it took.
    if (has_moved) room_.correct(0, taken);
    throw;
  }
  if (!has_moved) {
    const Lock lock(places_);
    const std::uint64_t replaced = size_of(place);
    move_to(path, place);
    stored(replaced);
  }
  if (folders_.outlive_crashes) sync_folder(place.parent_path());
  return traits;
}

// A folder may exist but not be on disk, if another thread has just made it or the process that
// made it was killed. So this process syncs all of them once.
void FileBlobStore::make_folder_for(const std::filesystem::path& place) {
  const Lock lock(folders_mutex_);
  std::error_code error;
  if (!has_folders_) {
    constexpr int kFolders = 256;
    for (int first = 0; first < kFolders; ++first) {
      const auto byte = static_cast<std::uint8_t>(first);
      std::filesystem::create_directory(folders_.blobs / to_hex(std::span(&byte, 1)), error);
    }
    if (folders_.outlive_crashes) sync_folder(folders_.blobs);
    has_folders_ = true;
  }
  const bool is_new = std::filesystem::create_directory(place.parent_path(), error);
  if (error == std::errc::no_space_on_device) {
    throw Error(ErrorCode::kOutOfSpace, "the data folder has no space left");
  }
  if (is_new && folders_.outlive_crashes) sync_folder(folders_.blobs);
}

}  // namespace isomesh::store
