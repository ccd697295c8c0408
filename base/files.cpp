#include "base/files.h"

#include <algorithm>
#include <cerrno>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/error.h"

namespace isomesh {

InputFile::InputFile(const std::filesystem::path& path) : InputFile(path, "") {}

InputFile InputFile::chosen(const std::filesystem::path& path) { return {path, path.string()}; }

// O_NONBLOCK: opening a pipe must not wait for its writer. A pipe is then rejected as not a regular
// file.
InputFile::InputFile(const std::filesystem::path& path, std::string shown)
    : shown_(std::move(shown)), file_(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)) {
  if (file_.number() < 0) fail("opening a file", errno);
  look();
}

InputFile::InputFile(Descriptor file, std::string shown)
    : shown_(std::move(shown)), file_(std::move(file)) {
  look();
}

void InputFile::look() {
  struct stat status = {};
  if (::fstat(file_.number(), &status) != 0) fail("reading a file's size", errno);
  if (!S_ISREG(status.st_mode)) {
    throw shown_.empty() ? Error(ErrorCode::kInternal, "not a regular file")
                         : Error(ErrorCode::kInvalidParameter, shown_ + " is not a regular file");
  }
  size_ = static_cast<std::uint64_t>(status.st_size);
}

void InputFile::fail(std::string_view call, int error_number) const {
  if (shown_.empty()) throw_file_error(call, error_number);
  throw Error(ErrorCode::kInvalidParameter,
              shown_ + ": " + std::generic_category().message(error_number));
}

std::size_t InputFile::read(std::uint64_t offset, std::span<std::byte> target) const {
  std::size_t done = 0;
  while (done < target.size() && offset + done < size_) {
    const ssize_t count = ::pread(file_.number(), target.data() + done, target.size() - done,
                                  static_cast<off_t>(offset + done));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) fail("reading a file", errno);
    if (count == 0) break;
    done += static_cast<std::size_t>(count);
  }
  return done;
}

void InputFile::read_exactly(std::uint64_t offset, std::span<std::byte> target) const {
  if (read(offset, target) == target.size()) return;
  throw shown_.empty()
      ? Error(ErrorCode::kInternal, "a file became shorter while it was read")
      : Error(ErrorCode::kInvalidParameter, shown_ + " became shorter while it was read");
}

std::string InputFile::text(std::uint64_t offset, std::size_t count) const {
  const std::uint64_t left = offset < size_ ? size_ - offset : 0;
  std::string result(static_cast<std::size_t>(std::min<std::uint64_t>(count, left)), '\0');
  result.resize(read(offset, std::as_writable_bytes(std::span(result))));
  return result;
}

ScratchFile::ScratchFile(const std::filesystem::path& folder, std::string_view suffix) {
  std::string name = (folder / "scratch-XXXXXX").string() + std::string(suffix);
  file_ = Descriptor(::mkostemps(name.data(), static_cast<int>(suffix.size()), O_CLOEXEC));
  if (file_.number() < 0) throw_system_error("making a temporary file", errno);
  path_ = name;
}

ScratchFile::~ScratchFile() {
  std::error_code ignored;
  std::filesystem::remove(path_, ignored);
}

void ScratchFile::write(std::span<const std::byte> bytes) { write_all(file_, bytes); }

bool same_bytes(const std::filesystem::path& one, const std::filesystem::path& other) {
  constexpr std::size_t kPieceBytes = std::size_t{1} << 18;
  const InputFile a(one);
  const InputFile b(other);
  if (a.size() != b.size()) return false;
  for (std::uint64_t at = 0; at < a.size(); at += kPieceBytes) {
    if (a.text(at, kPieceBytes) != b.text(at, kPieceBytes)) return false;
  }
  return true;
}

std::string read_whole(const std::filesystem::path& path) {
  const InputFile file(path);
  return file.text(0, file.size());
}

std::filesystem::path behind_links(const std::filesystem::path& path) {
  constexpr int kMostLinks = 40;  // the kernel's limit
  std::filesystem::path place = path;
  for (int links = 0; links <= kMostLinks; ++links) {
    std::error_code unknown;
    const std::filesystem::path target = std::filesystem::read_symlink(place, unknown);
    if (unknown) return place;
    place = place.parent_path() / target;  // the target alone if it is absolute
  }
  throw Error(ErrorCode::kInvalidParameter,
              path.string() + " leads through too many symbolic links");
}

}  // namespace isomesh
