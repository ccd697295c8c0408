#include "client/isomesh/file.h"

#include <cerrno>
#include <cstdio>
#include <ctime>
#include <mutex>
#include <set>
#include <string>
#include <system_error>
#include <tuple>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/files.h"
#include "base/ids.h"
#include "proto/error.h"

namespace isomesh {
namespace {

[[noreturn]] void fail(const std::filesystem::path& path, int reason) {
  const bool full = reason == ENOSPC || reason == EDQUOT;
  throw Error(full ? ErrorCode::kOutOfSpace : ErrorCode::kInvalidParameter,
              path.string() + ": " + std::generic_category().message(reason));
}

std::filesystem::path resolve(const std::filesystem::path& target, Existing existing) {
  std::error_code error;
  if (existing == Existing::kRefuse) {
    if (std::filesystem::exists(std::filesystem::symlink_status(target, error))) {
      fail(target, EEXIST);
    }
    return target;
  }
  const auto status = std::filesystem::status(target, error);
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)) {
    throw Error(ErrorCode::kInvalidParameter, target.string() + ": is not a regular file");
  }
  return behind_links(target);
}

std::filesystem::path folder_of(const std::filesystem::path& target) {
  return target.has_parent_path() ? target.parent_path() : ".";
}

std::filesystem::path part_beside(const std::filesystem::path& target) {
  // Without the target's name, which may be as long as a name can be.
  return folder_of(target) / (".isomesh-" + random_hex(8) + ".part");
}

// A process that was killed has left it: a download that runs writes all the time.
bool is_forsaken(const std::filesystem::path& path) {
  constexpr time_t kLongest = 86'400;
  const std::string name = path.filename().string();
  struct stat status = {};
  return name.starts_with(".isomesh-") && name.ends_with(".part") &&
         ::lstat(path.c_str(), &status) == 0 && S_ISREG(status.st_mode) &&
         status.st_uid == ::geteuid() && std::time(nullptr) - status.st_mtime > kLongest;
}

// Once in each folder: it may have many files, and as many meshes may be written to it.
void remove_forsaken(const std::filesystem::path& folder) {
  static std::mutex mutex;
  static std::set<std::filesystem::path> seen;
  {
    const std::scoped_lock lock(mutex);
    if (!seen.insert(folder).second) return;
  }
  std::error_code ignored;  // nobody needs it now
  for (std::filesystem::directory_iterator entry(folder, ignored), end; !ignored && entry != end;
       entry.increment(ignored)) {
    if (is_forsaken(entry->path())) ::unlink(entry->path().c_str());
  }
}

// A file that is replaced keeps its mode. A new one has 0666, reduced by the process's umask, like
// the output of any program.
int create(const std::filesystem::path& path, int flags, const std::filesystem::path& target) {
  struct stat old = {};
  const bool is_there = ::stat(target.c_str(), &old) == 0;
  const mode_t mode = is_there ? old.st_mode & 0777U : 0666U;
  const int file = ::open(path.c_str(), O_WRONLY | O_CLOEXEC | flags, mode);
  // Adds what the umask took. Where that fails, as on some network drives, the mode is narrower.
  if (is_there && file >= 0) std::ignore = ::fchmod(file, mode);
  return file;
}

// The path by which the kernel shows the file, so that it can be given a name.
std::string place_of(int file) { return "/proc/self/fd/" + std::to_string(file); }

// None if the file system or the machine does not have such files.
int create_unnamed(const std::filesystem::path& target) {
  const int file = create(folder_of(target), O_TMPFILE, target);
  if (file < 0 || ::access(place_of(file).c_str(), F_OK) == 0) return file;
  ::close(file);
  return -1;
}

}  // namespace

PartFile::PartFile(const std::filesystem::path& target, Until until, Existing existing)
    : target_(resolve(target, existing)), existing_(existing) {
  remove_forsaken(folder_of(target_));
  if (until == Until::kUnnamed) file_ = Descriptor(create_unnamed(target_));
  if (file_.number() >= 0) return;
  const std::filesystem::path part = part_beside(target_);
  file_ = Descriptor(create(part, O_CREAT | O_EXCL, target_));
  if (file_.number() < 0) fail(target, errno);
  part_ = part;
}

PartFile::~PartFile() {
  if (!part_.empty()) ::unlink(part_.c_str());
}

void PartFile::write(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t count = ::write(file_.number(), bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) fail(target_, errno);
    bytes.remove_prefix(static_cast<std::size_t>(count));
  }
}

void PartFile::restart() {
  if (::ftruncate(file_.number(), 0) != 0 || ::lseek(file_.number(), 0, SEEK_SET) != 0) {
    fail(target_, errno);
  }
}

bool PartFile::link_to(const std::filesystem::path& path) const {
  const std::string place = place_of(file_.number());
  return ::linkat(AT_FDCWD, place.c_str(), AT_FDCWD, path.c_str(), AT_SYMLINK_FOLLOW) == 0;
}

void PartFile::sync() {
  if (::fsync(file_.number()) != 0) fail(target_, errno);
}

// A link replaces nothing, and neither does this kind of rename, which some network drives lack.
bool PartFile::rename_to_target() const {
  if (existing_ == Existing::kReplace) return ::rename(part_.c_str(), target_.c_str()) == 0;
  if (::link(part_.c_str(), target_.c_str()) == 0) return ::unlink(part_.c_str()) == 0;
  return errno != EEXIST &&
         ::renameat2(AT_FDCWD, part_.c_str(), AT_FDCWD, target_.c_str(), RENAME_NOREPLACE) == 0;
}

void PartFile::publish() {
  sync();
  if (part_.empty()) {
    if (link_to(target_)) return;
    if (existing_ == Existing::kRefuse && errno == EEXIST) fail(target_, EEXIST);
    // Only a rename replaces a file.
    const std::filesystem::path part = part_beside(target_);
    part_ = part;
    if (!link_to(part)) {  // some file systems have no links
      std::error_code error;
      std::filesystem::copy_file(place_of(file_.number()), part, error);
      if (error) fail(target_, error.value());
    }
  }
  if (!rename_to_target()) fail(target_, errno);
  part_.clear();
}

}  // namespace isomesh
