#include "tests/faults/small_disk.h"

#include <stdexcept>

#include <fcntl.h>

#include "base/descriptor.h"

namespace isomesh::test {

SmallDisk::SmallDisk(std::uint64_t bytes) {
  const std::string script = "mount -t tmpfs -o mode=700,size=" + std::to_string(bytes) +
                             " small-disk \"$0\" && echo mounted && exec sleep 100000";
  holder_.emplace(std::vector<std::string>{"unshare", "--user", "--map-root-user", "--mount", "sh",
                                           "-c", script, folder_.path()});
  is_mounted_ = holder_->first_line() == "mounted";
}

std::vector<std::string> SmallDisk::prefix() const {
  return {"nsenter",  "--preserve-credentials",      "--user", "--mount",
          "--target", std::to_string(holder_->pid())};
}

std::filesystem::path SmallDisk::outside() const {
  return "/proc/" + std::to_string(holder_->pid()) + "/root" + folder_.path().string();
}

void SmallDisk::fill(const std::string& name, std::uint64_t leave) const {
  const Descriptor file(::open((outside() / name).c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0600));
  if (file.number() < 0) throw std::runtime_error("the disk cannot be filled");
  off_t place = 0;
  // Others write there meanwhile, so what was free may not be any more.
  const bool is_full = eventually([&] {
    const std::uint64_t free = free_bytes();
    if (free <= leave) return true;
    const auto more = static_cast<off_t>(free - leave);
    if (::posix_fallocate(file.number(), place, more) == 0) place += more;
    return free_bytes() <= leave;
  });
  if (!is_full) throw std::runtime_error("the disk is not full");
}

}  // namespace isomesh::test
