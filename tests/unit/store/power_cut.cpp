#include "tests/unit/store/power_cut.h"

#include <mutex>
#include <set>
#include <stdexcept>
#include <utility>

#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "tests/support/files.h"

namespace isomesh::test {
namespace {

// Guards all recorders, and what they remember.
std::mutex& recorders_mutex() {
  static std::mutex mutex;
  return mutex;
}

std::set<PowerCut*>& recorders() {
  static std::set<PowerCut*> all;
  return all;
}

int synced(int descriptor, int result) {
  const std::lock_guard lock(recorders_mutex());
  for (PowerCut* const recorder : recorders()) {
    if (result == 0) recorder->remember(descriptor);
  }
  return result;
}

ino_t inode_of(const std::filesystem::path& path) {
  struct stat status = {};
  ::stat(path.c_str(), &status);
  return status.st_ino;
}

// Through the descriptor itself: closing another one would give up SQLite's locks.
std::string bytes_behind(int descriptor, off_t size) {
  std::string bytes(static_cast<std::size_t>(size), '\0');
  std::size_t read = 0;
  while (read < bytes.size()) {
    const ssize_t count =
        ::pread(descriptor, bytes.data() + read, bytes.size() - read, static_cast<off_t>(read));
    if (count <= 0) throw std::runtime_error("a synced file cannot be read");
    read += static_cast<std::size_t>(count);
  }
  return bytes;
}

}  // namespace

PowerCut::PowerCut(std::filesystem::path folder) : folder_(std::move(folder)) {
  const std::lock_guard lock(recorders_mutex());
  recorders().insert(this);
}

PowerCut::~PowerCut() {
  const std::lock_guard lock(recorders_mutex());
  recorders().erase(this);
}

void PowerCut::leave(const std::filesystem::path& target) const {
  const std::lock_guard lock(recorders_mutex());
  leave(folder_, target);
}

std::size_t PowerCut::syncs() const {
  const std::lock_guard lock(recorders_mutex());
  return syncs_;
}

void PowerCut::remember(int descriptor) {
  const std::filesystem::path path =
      std::filesystem::read_symlink("/proc/self/fd/" + std::to_string(descriptor));
  if (!path.native().starts_with(folder_.native())) return;
  ++syncs_;
  struct stat status = {};
  ::fstat(descriptor, &status);
  if (!S_ISDIR(status.st_mode)) {
    files_[status.st_ino] = bytes_behind(descriptor, status.st_size);
    return;
  }
  std::map<std::string, ino_t>& names = folders_[path];
  names.clear();
  std::error_code gone;  // files come and go while we look
  for (const auto& entry : std::filesystem::directory_iterator(path)) {
    names[entry.path().filename()] = entry.is_directory(gone) ? 0 : inode_of(entry);
  }
}

void PowerCut::leave(const std::filesystem::path& folder,
                     const std::filesystem::path& target) const {
  std::filesystem::create_directories(target);
  const auto names = folders_.find(folder);
  if (names == folders_.end()) return;
  for (const auto& [name, inode] : names->second) {
    if (inode == 0) {
      leave(folder / name, target / name);
    } else {
      const auto bytes = files_.find(inode);
      write_file(target / name, bytes == files_.end() ? std::string() : bytes->second);
    }
  }
}

}  // namespace isomesh::test

// In place of the C library's, for SQLite too.
extern "C" int fsync(int descriptor) {
  return isomesh::test::synced(descriptor, static_cast<int>(::syscall(SYS_fsync, descriptor)));
}

extern "C" int fdatasync(int descriptor) {
  return isomesh::test::synced(descriptor, static_cast<int>(::syscall(SYS_fdatasync, descriptor)));
}
