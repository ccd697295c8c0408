#include "server/jobs/making/memory.h"

#include <algorithm>
#include <charconv>
#include <fstream>
#include <optional>
#include <string>

#include <malloc.h>
#include <unistd.h>

namespace isomesh::jobs {
namespace {

std::uint64_t memory_of_machine() {
  return static_cast<std::uint64_t>(::sysconf(_SC_PHYS_PAGES)) *
         static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
}

// The number at the start of a file; empty if there is no such file, and for "max".
std::optional<std::uint64_t> number_in(const std::filesystem::path& file) {
  std::ifstream stream(file);
  std::string text;
  std::getline(stream, text);
  std::uint64_t number = 0;
  const auto end = std::from_chars(text.data(), text.data() + text.size(), number);
  if (end.ec != std::errc()) return std::nullopt;
  return number;
}

// The least limit of a group or one above it. Paths of groups may begin above the folder that a
// container sees, so the folder itself is always looked at.
std::uint64_t least_limit(const std::filesystem::path& folder, const std::string& group,
                          const char* name) {
  std::uint64_t least = number_in(folder / name).value_or(memory_of_machine());
  std::filesystem::path place = folder;
  for (const auto& part : std::filesystem::path(group).relative_path()) {
    place /= part;
    if (const auto limit = number_in(place / name)) least = std::min(least, *limit);
  }
  return least;
}

}  // namespace

std::uint64_t usable_memory(const std::filesystem::path& root) {
  std::uint64_t least = memory_of_machine();
  const std::filesystem::path groups = root / "sys/fs/cgroup";
  std::ifstream stream(root / "proc/self/cgroup");
  // Lines are of the form number:controllers:group; version 2 names no controllers.
  for (std::string line; std::getline(stream, line);) {
    const std::size_t first = line.find(':');
    const std::size_t second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) continue;
    const std::string controllers = ',' + line.substr(first + 1, second - first - 1) + ',';
    const std::string group = line.substr(second + 1);
    if (controllers == ",,") least = std::min(least, least_limit(groups, group, "memory.max"));
    if (controllers.find(",memory,") != std::string::npos) {
      least = std::min(least, least_limit(groups / "memory", group, "memory.limit_in_bytes"));
    }
  }
  return least;
}

void give_back_freed_memory() { ::malloc_trim(0); }

void keep_freed_memory() {
  constexpr int kLargestBlockBytes = 32 << 20;  // the largest that the C library allows
  constexpr int kKeptBytes = 256 << 20;
  ::mallopt(M_MMAP_THRESHOLD, kLargestBlockBytes);
  ::mallopt(M_TRIM_THRESHOLD, kKeptBytes);
}

}  // namespace isomesh::jobs
