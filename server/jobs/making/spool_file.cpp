#include "server/jobs/making/spool_file.h"

#include <cerrno>
#include <string>
#include <string_view>

#include <fcntl.h>
#include <stdlib.h>
#include <unistd.h>

#include "base/error.h"
#include "proto/error.h"

namespace isomesh::jobs {
namespace {

[[noreturn]] void fail(std::string_view call, int error_number) {
  if (error_number == ENOSPC || error_number == EDQUOT) {
    throw Error(ErrorCode::kOutOfSpace, "the disk has no room for what a job sets aside");
  }
  if (error_number == EFBIG) {
    throw Error(ErrorCode::kTooLarge, "the surface is too large: the job sets aside too much");
  }
  throw_system_error(call, error_number);
}

// Not every file system has files without a name.
Descriptor open_in(const std::filesystem::path& folder) {
  Descriptor file(::open(folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, S_IRUSR | S_IWUSR));
  if (file.number() >= 0) return file;
  std::string name = (folder / "spool-XXXXXX").string();
  file = Descriptor(::mkostemp(name.data(), O_CLOEXEC));
  if (file.number() < 0) fail("mkostemp", errno);
  if (::unlink(name.c_str()) != 0) fail("unlink", errno);
  return file;
}

}  // namespace

SpoolFile::SpoolFile(const std::filesystem::path& folder) : file_(open_in(folder)) {}

void SpoolFile::write(std::uint64_t at, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t count =
        ::pwrite(file_.number(), bytes.data(), bytes.size(), static_cast<off_t>(at));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) fail("pwrite", errno);
    bytes = bytes.subspan(static_cast<std::size_t>(count));
    at += static_cast<std::uint64_t>(count);
  }
}

void SpoolFile::read(std::uint64_t at, std::span<std::byte> bytes) const {
  while (!bytes.empty()) {
    const ssize_t count =
        ::pread(file_.number(), bytes.data(), bytes.size(), static_cast<off_t>(at));
    if (count < 0 && errno == EINTR) continue;
    if (count == 0) throw Error(ErrorCode::kInternal, "what a job set aside is not there");
    if (count < 0) fail("pread", errno);
    bytes = bytes.subspan(static_cast<std::size_t>(count));
    at += static_cast<std::uint64_t>(count);
  }
}

void SpoolFile::clear() {
  begin_again();
  if (::ftruncate(file_.number(), 0) != 0) fail("ftruncate", errno);
}

}  // namespace isomesh::jobs
