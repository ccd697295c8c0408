#include "base/held_folder.h"

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <optional>
#include <string_view>
#include <system_error>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/error.h"

namespace isomesh {
namespace {

constexpr std::string_view kDescriptors = "/proc/self/fd/";

Descriptor opened(const std::filesystem::path& place) {
  Descriptor folder(::open(place.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (folder.number() < 0) throw_file_error("opening a folder", errno);
  return folder;
}

bool is_same(const struct stat& one, const struct stat& other) {
  return one.st_dev == other.st_dev && one.st_ino == other.st_ino;
}

// Empty if the kernel does not tell.
std::optional<std::uint64_t> mount_of(int folder, const char* path) {
  struct statx status = {};
  const bool is_told = ::statx(folder, path, AT_EMPTY_PATH, STATX_MNT_ID, &status) == 0 &&
                       (status.stx_mask & STATX_MNT_ID) != 0;
  return is_told ? std::optional<std::uint64_t>(status.stx_mnt_id) : std::nullopt;
}

// The folder was unmounted while it was open, and mounted again. Other processes find nothing by
// the earlier mount. If this fails, the next look repeats it.
void hold_by_present_mount(const Descriptor& folder, const std::filesystem::path& place) {
  const Descriptor again(::open(place.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  struct stat held = {};
  struct stat there = {};
  if (::fstat(folder.number(), &held) == 0 && ::fstat(again.number(), &there) == 0 &&
      is_same(held, there)) {
    ::dup3(again.number(), folder.number(), O_CLOEXEC);
  }
}

}  // namespace

HeldFolder::HeldFolder(const std::filesystem::path& place)
    : place_(std::filesystem::absolute(place)),
      folder_(opened(place)),
      path_(std::string(kDescriptors) + std::to_string(folder_.number())) {}

bool HeldFolder::is_at_place() const {
  struct stat held = {};
  struct stat there = {};
  if (::fstat(folder_.number(), &held) != 0 || ::stat(place_.c_str(), &there) != 0) return false;
  if (!is_same(held, there)) return false;
  // The place may be mounted read-only although the open folder is not.
  if (::faccessat(AT_FDCWD, place_.c_str(), R_OK | W_OK | X_OK, AT_EACCESS) != 0) return false;
  if (mount_of(folder_.number(), "") != mount_of(AT_FDCWD, place_.c_str())) {
    hold_by_present_mount(folder_, place_);
  }
  return true;
}

std::filesystem::path for_other_process(const std::filesystem::path& path) {
  const std::string& text = path.native();
  if (!text.starts_with(kDescriptors)) return path;
  const std::size_t end = std::min(text.find('/', kDescriptors.size()), text.size());
  std::error_code gone;
  const std::filesystem::path folder = std::filesystem::read_symlink(text.substr(0, end), gone);
  return gone ? path : std::filesystem::path(folder.native() + text.substr(end));
}

}  // namespace isomesh
