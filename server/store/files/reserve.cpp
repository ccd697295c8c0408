#include "server/store/files/reserve.h"

#include <algorithm>
#include <limits>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <unistd.h>

#include "base/descriptor.h"
#include "base/log.h"
#include "proto/error.h"

namespace isomesh::store {
namespace {

// Divisor: this fraction of the reserve must be free besides. It lets records grow while no new
// work starts, and keeps small changes from taking and releasing the reserve repeatedly.
constexpr std::uint64_t kMargin = 4;

std::filesystem::space_info space_of(const std::filesystem::path& folder) {
  std::error_code unknown;
  const auto space = std::filesystem::space(folder, unknown);
  if (!unknown) return space;
  constexpr auto kMuch = std::numeric_limits<std::uintmax_t>::max();
  return {kMuch, kMuch, kMuch};  // writing reports the error
}

}  // namespace

Reserve::Reserve(std::filesystem::path file, std::uint64_t bytes)
    : file_(std::move(file)), bytes_(bytes) {
  std::error_code absent;
  if (free_bytes() < bytes_ / kMargin || bytes_ == 0) std::filesystem::remove(file_, absent);
  const Lock lock(mutex_);
  is_whole_ = bytes_ == 0 || std::filesystem::file_size(file_, absent) == bytes_ || take();
}

bool Reserve::has_room() {
  if (bytes_ == 0) return true;
  const Lock lock(mutex_);
  if (!is_whole_) is_whole_ = take();
  return is_whole_ && free_bytes() >= bytes_ / kMargin;
}

void Reserve::check_room() {
  if (has_room()) return;
  throw Error(ErrorCode::kOutOfSpace, "the data folder has no space left");
}

void Reserve::let_go() {
  const Lock lock(mutex_);
  if (bytes_ == 0 || !is_whole_) return;
  std::error_code error;
  std::filesystem::remove(file_, error);
  is_whole_ = false;
  log_warning(
      "the disk is full: its reserve was released, and nothing new starts until the reserve is "
      "back");
}

std::uint64_t Reserve::free_bytes() const { return space_of(file_.parent_path()).available; }

std::uint64_t Reserve::capacity() const {
  const std::uint64_t all = space_of(file_.parent_path()).capacity;
  return all - std::min(all, bytes_ + bytes_ / kMargin);
}

std::uint64_t Reserve::usual_bytes(const std::filesystem::path& folder) {
  constexpr std::uint64_t kShare = 32;
  constexpr std::uint64_t kLeast = std::uint64_t{2} << 20;
  constexpr std::uint64_t kMost = std::uint64_t{64} << 20;
  return std::clamp<std::uint64_t>(space_of(folder).capacity / kShare, kLeast, kMost);
}

// Takes the whole reserve or nothing.
bool Reserve::take() {
  if (free_bytes() < bytes_ + bytes_ / kMargin) return false;
  const Descriptor file(::open(file_.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600));
  const bool is_taken =
      file.number() >= 0 && ::posix_fallocate(file.number(), 0, static_cast<off_t>(bytes_)) == 0;
  std::error_code absent;
  if (!is_taken) std::filesystem::remove(file_, absent);
  return is_taken;
}

}  // namespace isomesh::store
