// The state of a folder after a power cut.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>

#include <sys/types.h>

namespace isomesh::test {

// Remembers what this process brings to the disk below a folder with fsync and fdatasync, whoever
// calls them, as strictly as POSIX allows: of a file its bytes when it was last synced, of a folder
// the names that it had then. The kernel, which writes more than it is asked for, has no part in
// it. Thread safe.
class PowerCut {
 public:
  explicit PowerCut(std::filesystem::path folder);
  ~PowerCut();
  PowerCut(const PowerCut&) = delete;
  PowerCut& operator=(const PowerCut&) = delete;

  // Writes what would be there if the power failed now to `target`, an empty folder.
  void leave(const std::filesystem::path& target) const;

  // How often something was brought to the disk below the folder.
  std::size_t syncs() const;

  // Called after each sync of a descriptor, by one thread at a time.
  void remember(int descriptor);

 private:
  void leave(const std::filesystem::path& folder, const std::filesystem::path& target) const;

  const std::filesystem::path folder_;
  std::size_t syncs_ = 0;
  std::map<ino_t, std::string> files_;
  std::map<std::filesystem::path, std::map<std::string, ino_t>> folders_;
};

}  // namespace isomesh::test
