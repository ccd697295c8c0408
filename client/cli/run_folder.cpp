#include "client/cli/run_folder.h"

#include <cerrno>
#include <cstdlib>
#include <string>
#include <string_view>
#include <system_error>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/ids.h"
#include "proto/error.h"

namespace isomesh::cli {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kPrefix = "isomesh-run-";

// The folder for temporary files. Throws Error kInvalidParameter with its name if it is not a
// folder.
std::filesystem::path temporary_folder() {
  std::error_code error;
  std::filesystem::path folder = std::filesystem::temp_directory_path(error);
  if (!error) return folder;
  std::string place = "/tmp";
  // The variables that the library looks at; it prefers the last of them.
  for (const std::string name : {"TEMPDIR", "TEMP", "TMP", "TMPDIR"}) {
    if (const char* const value = std::getenv(name.c_str())) place = name + '=' + value;
  }
  throw Error(ErrorCode::kInvalidParameter,
              "the folder for temporary files cannot be used: " + place + ": " + error.message() +
                  "; set TMPDIR to an existing folder");
}

fs::path lock_of(const fs::path& folder) { return folder / "lock"; }

// None if the folder is gone.
Descriptor open_lock(const fs::path& folder) {
  return Descriptor(
      ::open(lock_of(folder).c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0600));
}

bool is_own_folder(const fs::path& path) {
  struct stat status = {};
  return ::lstat(path.c_str(), &status) == 0 && S_ISDIR(status.st_mode) &&
         status.st_uid == ::geteuid();
}

// True if the folder still has the lock that was opened.
bool has_lock(const fs::path& folder, const Descriptor& lock) {
  struct stat there = {};
  struct stat own = {};
  return ::stat(lock_of(folder).c_str(), &there) == 0 && ::fstat(lock.number(), &own) == 0 &&
         there.st_dev == own.st_dev && there.st_ino == own.st_ino;
}

// Removes the folder if no process holds its lock. The folder is renamed first, so that a run that
// has just made it and waits for the lock finds that it is gone.
void remove_if_forsaken(const fs::path& folder) {
  const Descriptor lock = open_lock(folder);
  if (lock.number() < 0 || ::flock(lock.number(), LOCK_EX | LOCK_NB) != 0) return;
  const fs::path doomed = folder.parent_path() / (std::string(kPrefix) + random_hex(8));
  std::error_code ignored;  // the next run tries again
  fs::rename(folder, doomed, ignored);
  if (!ignored) fs::remove_all(doomed, ignored);
}

void remove_forsaken(const fs::path& place) {
  std::error_code ignored;
  for (fs::directory_iterator entry(place, ignored), end; !ignored && entry != end;
       entry.increment(ignored)) {
    const bool is_one = entry->path().filename().string().starts_with(kPrefix);
    if (is_one && is_own_folder(entry->path())) remove_if_forsaken(entry->path());
  }
}

}  // namespace

RunFolder::RunFolder() {
  const fs::path place = temporary_folder();
  remove_forsaken(place);
  do {
    std::string name = (place / (std::string(kPrefix) + "XXXXXX")).string();
    if (::mkdtemp(name.data()) == nullptr) {
      throw Error(ErrorCode::kInvalidParameter, "a temporary folder cannot be created: " + name +
                                                    ": " + std::generic_category().message(errno));
    }
    path_ = name;
    lock_ = open_lock(path_);
    const bool may_be_gone = lock_.number() >= 0 || errno == ENOENT;
    if (!may_be_gone) {
      const int reason = errno;
      ::rmdir(path_.c_str());
      throw Error(ErrorCode::kInvalidParameter,
                  "a temporary file cannot be created: " + std::generic_category().message(reason));
    }
    // Another run that takes the folder for forsaken may hold it for a moment. Some network drives
    // have no locks; there nobody gets one, and no folder is taken for forsaken.
    while (::flock(lock_.number(), LOCK_EX) != 0 && errno == EINTR) {
    }
  } while (!has_lock(path_, lock_));
}

RunFolder::~RunFolder() {
  std::error_code ignored;  // the next run tries again
  fs::remove_all(path_, ignored);
}

}  // namespace isomesh::cli
