#include "client/isomesh/file.h"

#include <cerrno>
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

std::filesystem::path resolve(const std::filesystem::path& target) {
  std::error_code error;
  const auto status = std::filesystem::status(target, error);
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)) {
    throw Error(ErrorCode::kInvalidParameter, target.string() + ": is not a regular file");
  }
  return behind_links(target);
}

std::filesystem::path part_beside(const std::filesystem::path& target) {
  // Without the target's name, which may be as long as a name can be.
  return target.parent_path() / (".isomesh-" + random_hex(8) + ".part");
}

// A file that is replaced keeps its mode. A new one has 0666, reduced by the process's umask, like
// the output of any program.
int create(const std::filesystem::path& part, const std::filesystem::path& target) {
  struct stat old = {};
  const bool is_there = ::stat(target.c_str(), &old) == 0;
  const mode_t mode = is_there ? old.st_mode & 0777U : 0666U;
  const int file = ::open(part.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
  // Adds what the umask took. Where that fails, as on some network drives, the mode is narrower.
  if (is_there && file >= 0) std::ignore = ::fchmod(file, mode);
  return file;
}

}  // namespace

PartFile::PartFile(const std::filesystem::path& target)
    : target_(resolve(target)), part_(part_beside(target_)), file_(create(part_, target_)) {
  if (file_.number() < 0) fail(target, errno);
}

PartFile::~PartFile() {
  if (!published_) ::unlink(part_.c_str());
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

void PartFile::publish() {
  if (::fsync(file_.number()) != 0 || ::rename(part_.c_str(), target_.c_str()) != 0) {
    fail(target_, errno);
  }
  published_ = true;
}

}  // namespace isomesh
