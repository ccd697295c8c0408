#include "server/store/files/data_folder.h"

#include <cerrno>
#include <chrono>
#include <cstring>
#include <initializer_list>
#include <thread>

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include "base/files.h"
#include "base/ids.h"
#include "base/log.h"
#include "proto/error.h"
#include "server/store/file.h"

namespace isomesh::store {
namespace {

constexpr const char* kDataFolder = "the data folder";

// Errors name files without the path above them.
void make_folders(const std::string& place, std::initializer_list<std::filesystem::path> folders) {
  for (const auto& folder : folders) {
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    if (!error) continue;
    throw_system_error(place + ": making " + folder.filename().string(), error.value());
  }
}

// Another user, such as root, may have used the data folder before. Only names of the daemon's own
// are looked at: a file system of its own has lost+found.
void check_access(const std::filesystem::path& root) {
  for (const char* name : {"lock", "reserve", "scratch", "blobs", "blobs/identity", "quarantine",
                           "erasing", "uploads", "isomesh.sqlite"}) {
    const std::filesystem::path path = root / name;
    if (::faccessat(AT_FDCWD, path.c_str(), R_OK | W_OK, AT_EACCESS) == 0 || errno == ENOENT) {
      continue;
    }
    throw_system_error(kDataFolder + (": this user must be able to write to " + std::string(name)),
                       errno);
  }
}

// A daemon that was killed can leave its lock for a moment to a process that it was starting.
bool locks_soon(int descriptor) {
  for (int tries = 0; ::flock(descriptor, LOCK_EX | LOCK_NB) != 0; ++tries) {
    constexpr int kMostTries = 50;
    if (tries == kMostTries) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return true;
}

// Creates the folder if it is missing.
std::filesystem::path made(const std::filesystem::path& root) {
  std::error_code error;
  // The contents may identify patients. The rights of an existing folder stay as they are.
  if (std::filesystem::create_directories(root, error)) {
    std::filesystem::permissions(root, std::filesystem::perms::owner_all, error);
  }
  if (error) throw Error(ErrorCode::kInternal, kDataFolder + (": " + error.message()));
  if (::faccessat(AT_FDCWD, root.c_str(), R_OK | W_OK | X_OK, AT_EACCESS) != 0) {
    throw_system_error(kDataFolder, errno);
  }
  return root;
}

}  // namespace

Error missing_folder() {
  return {ErrorCode::kUnavailable, "the storage of the service is missing; nothing is lost"};
}

BlobFolders shared_blob_folders(const std::filesystem::path& root) {
  std::error_code error;
  if (!std::filesystem::is_directory(root, error)) {
    throw Error(ErrorCode::kUnavailable,
                "the folder of --blobs does not exist: is it mounted? isomeshd does not create it");
  }
  const auto place = std::filesystem::canonical(root, error);
  if (error) throw_system_error("finding the folder of --blobs", error.value());
  const BlobFolders folders = {.blobs = place / "blobs",
                               .quarantine = place / "quarantine",
                               .drafts = place / "drafts",
                               .holds = place / "holds"};
  make_folders("the folder of --blobs",
               {folders.blobs, folders.quarantine, folders.drafts, folders.holds});
  sync_folder(place);
  return folders;
}

DataFolder::DataFolder(const std::filesystem::path& root, std::optional<std::uint64_t> reserve)
    : folder_(made(root)) {
  std::error_code error;
  if (std::filesystem::exists(this->root() / kUnfinishedRestore, error)) {
    throw Error(ErrorCode::kUnavailable,
                std::filesystem::canonical(root).string() + ' ' + kRestoreAgain);
  }
  lock_ = Descriptor(::open((this->root() / "lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600));
  if (lock_.number() < 0) {
    throw Error(ErrorCode::kInternal, std::string(kDataFolder) + ": " + std::strerror(errno));
  }
  if (!locks_soon(lock_.number())) {
    throw Error(ErrorCode::kUnavailable, "another isomeshd is using the data folder");
  }
  check_access(this->root());
  std::error_code left;  // by its code, because a text of the library names the path
  std::filesystem::remove_all(scratch(), left);
  if (left) throw_system_error(kDataFolder + std::string(": emptying scratch"), left.value());
  // Before anything is written: on a full disk this frees the necessary space.
  reserve_ = std::make_unique<Reserve>(this->root() / "reserve",
                                       reserve.value_or(Reserve::usual_bytes(this->root())));
  make_folders(kDataFolder, {blobs(), quarantine(), scratch(), erasing()});
  sync_folder(this->root());
}

bool DataFolder::is_there() const {
  const bool is = folder_.is_at_place();
  const bool was_missing = is_missing_.exchange(!is);
  if (!is && !was_missing) {
    log_error(
        "the data folder is missing: it is not at its place, another folder is there, or it cannot "
        "be written to. Jobs wait until it is back. If it was mounted anew and this goes on, "
        "restart isomeshd");
  }
  if (is && was_missing) log_info("the data folder is back");
  return is;
}

void DataFolder::check_is_there() const {
  if (!is_there()) throw missing_folder();
}

bool DataFolder::works() const { return is_there() && can_write_in(root()); }

bool DataFolder::responds() const {
  return is_there() && health_.passes([this] { return works(); });
}

BlobFolders DataFolder::blob_folders() const {
  return {.blobs = blobs(), .quarantine = quarantine(), .drafts = scratch(), .data = this};
}

std::string DataFolder::name() const {
  const std::filesystem::path place = root() / "name";
  if (!std::filesystem::exists(place)) {
    const std::filesystem::path draft = scratch() / random_hex(8);
    const std::string name = random_hex(16);
    File file = File::create(draft);
    file.write(std::as_bytes(std::span(name)));
    file.sync();
    move_to(draft, place);
    sync_folder(root());
  }
  return read_whole(place);
}

BlobFolders DataFolder::cache_folders() const {
  const std::filesystem::path cache = root() / "cache";
  BlobFolders folders = blob_folders();
  folders.blobs = cache / "blobs";
  folders.quarantine = cache / "quarantine";
  folders.outlive_crashes = false;
  make_folders(kDataFolder, {folders.blobs, folders.quarantine});
  return folders;
}

ScratchFolder::ScratchFolder(const std::filesystem::path& parent) : path_(parent / random_hex(8)) {
  std::error_code error;
  std::filesystem::create_directory(path_, error);
  if (error == std::errc::no_space_on_device) {
    throw Error(ErrorCode::kOutOfSpace, "the data folder has no space left");
  }
  if (error) throw Error(ErrorCode::kInternal, "a scratch folder: " + error.message());
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;  // leftovers are removed at the next start
  std::filesystem::remove_all(path_, ignored);
}

}  // namespace isomesh::store
