#include "server/store/file.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "base/descriptor.h"
#include "base/error.h"
#include "base/ids.h"

namespace isomesh::store {

File File::create(const std::filesystem::path& path) {
  Descriptor descriptor(::open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  if (descriptor.number() < 0) throw_file_error("creating a file", errno);
  return File(std::move(descriptor));
}

File File::open(const std::filesystem::path& path) {
  Descriptor descriptor(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (descriptor.number() < 0) throw_file_error("opening a file", errno);
  return File(std::move(descriptor));
}

void File::write(std::span<const std::byte> bytes) { write_all(descriptor_, bytes); }

std::size_t File::read_at(std::uint64_t offset, std::span<std::byte> bytes) const {
  std::size_t total = 0;
  while (total < bytes.size()) {
    const ssize_t count = ::pread(descriptor_.number(), bytes.data() + total, bytes.size() - total,
                                  static_cast<off_t>(offset + total));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw_file_error("reading a file", errno);
    if (count == 0) break;
    total += static_cast<std::size_t>(count);
  }
  return total;
}

std::uint64_t File::read(const Take& take, std::uint64_t begin, std::uint64_t bytes) const {
  constexpr std::uint64_t kBlockBytes = std::uint64_t{1} << 20;
  std::vector<std::byte> block(static_cast<std::size_t>(std::min(bytes, kBlockBytes)));
  std::uint64_t done = 0;
  while (done < bytes) {
    const auto wanted = std::min<std::uint64_t>(block.size(), bytes - done);
    const std::size_t count =
        read_at(begin + done, std::span(block).first(static_cast<std::size_t>(wanted)));
    if (count == 0) break;
    take(std::span(block).first(count));
    done += count;
  }
  return done;
}

std::uint64_t File::size() const {
  struct stat status = {};
  if (::fstat(descriptor_.number(), &status) != 0) throw_file_error("reading a file's size", errno);
  return static_cast<std::uint64_t>(status.st_size);
}

void File::begin_sync() const {
  // A hint only; not every file system supports it.
  ::sync_file_range(descriptor_.number(), 0, 0, SYNC_FILE_RANGE_WRITE);
}

void File::sync() const {
  if (::fsync(descriptor_.number()) != 0) throw_file_error("syncing a file", errno);
}

void move_to(const std::filesystem::path& from, const std::filesystem::path& to) {
  if (::rename(from.c_str(), to.c_str()) != 0) throw_file_error("renaming a file", errno);
}

bool move_to_free_place(const std::filesystem::path& from, const std::filesystem::path& to) {
  if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return true;
  // EINVAL means that the file system does not support this; the caller then treats the place as
  // taken.
  if (errno == EEXIST || errno == EINVAL || errno == ENOSYS) return false;
  throw_file_error("renaming a file", errno);
}

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

bool can_write_in(const std::filesystem::path& folder) {
  const std::filesystem::path file = folder / ("probe-" + random_hex(8));
  try {
    File::create(file);
  } catch (const Error& error) {
    return error.code() == ErrorCode::kOutOfSpace || error.code() == ErrorCode::kUnavailable;
  }
  std::error_code failure;
  std::filesystem::remove(file, failure);
  return !failure;
}

void sync_folder(const std::filesystem::path& folder) {
  const Descriptor opened(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (opened.number() < 0) throw_file_error("opening a folder", errno);
  if (::fsync(opened.number()) != 0) throw_file_error("syncing a folder", errno);
}

}  // namespace isomesh::store
