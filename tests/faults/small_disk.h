// A disk of a few megabytes that can be filled up.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tests/support/files.h"
#include "tests/support/process.h"

namespace isomesh::test {

// A file system in memory, mounted in namespaces of its own, which every user may make where the
// system allows that. Gone with all it holds when it goes.
class SmallDisk {
 public:
  explicit SmallDisk(std::uint64_t bytes);

  // False where the system does not allow it; then nothing else may be called.
  bool is_mounted() const { return is_mounted_; }

  // Put before a command, has it see the disk.
  std::vector<std::string> prefix() const;
  // Its folder as such a command sees it, and as this process does.
  std::filesystem::path inside() const { return folder_.path(); }
  std::filesystem::path outside() const;

  std::uint64_t free_bytes() const { return std::filesystem::space(outside()).available; }
  // Leaves so many bytes free, and puts the others into a file of that name.
  void fill(const std::string& name, std::uint64_t leave = 0) const;

 private:
  TemporaryFolder folder_;
  std::optional<Process> holder_;  // of the namespaces
  bool is_mounted_ = false;
};

}  // namespace isomesh::test
