#include "server/volume/files.h"

#include <cerrno>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "proto/error.h"

namespace isomesh::volume {

Descriptor::~Descriptor() {
  if (number_ >= 0) ::close(number_);
}

Descriptor::Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}

Descriptor& Descriptor::operator=(Descriptor&& other) noexcept {
  std::swap(number_, other.number_);
  return *this;
}

void throw_system_error(std::string_view call, int error_number) {
  if (error_number == ENOSPC || error_number == EDQUOT || error_number == EFBIG) {
    throw Error(ErrorCode::kOutOfSpace, "There is not enough room on the disk for this volume.");
  }
  throw Error(ErrorCode::kInternal, std::string(call) + " failed: " +
                                        std::generic_category().message(error_number) + ".");
}

void write_all(const Descriptor& file, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = ::write(file.number(), bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw_system_error("write", errno);
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
}

InputFile::InputFile(const std::filesystem::path& path)
    : file_(::open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
  if (file_.number() < 0) throw_system_error("open", errno);
  struct stat status = {};
  if (::fstat(file_.number(), &status) != 0) throw_system_error("fstat", errno);
  if (!S_ISREG(status.st_mode)) throw Error(ErrorCode::kInternal, "Not a regular file.");
  size_ = static_cast<std::uint64_t>(status.st_size);
}

std::size_t InputFile::read(std::uint64_t offset, std::span<std::byte> target) const {
  std::size_t done = 0;
  while (done < target.size() && offset + done < size_) {
    const ssize_t count = ::pread(file_.number(), target.data() + done, target.size() - done,
                                  static_cast<off_t>(offset + done));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw_system_error("pread", errno);
    if (count == 0) break;
    done += static_cast<std::size_t>(count);
  }
  return done;
}

std::string InputFile::text(std::uint64_t offset, std::size_t count) const {
  std::string result(count, '\0');
  result.resize(read(offset, std::as_writable_bytes(std::span(result))));
  return result;
}

ScratchFile::ScratchFile(const std::filesystem::path& folder, std::string_view suffix) {
  std::string name = (folder / "import-XXXXXX").string() + std::string(suffix);
  file_ = Descriptor(::mkostemps(name.data(), static_cast<int>(suffix.size()), O_CLOEXEC));
  if (file_.number() < 0) throw_system_error("mkostemps", errno);
  path_ = name;
}

ScratchFile::~ScratchFile() {
  std::error_code ignored;
  std::filesystem::remove(path_, ignored);
}

void ScratchFile::write(std::span<const std::byte> bytes) { write_all(file_, bytes); }

}  // namespace isomesh::volume
