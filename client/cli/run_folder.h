// A folder for the temporary files of one run; private to this folder.
#pragma once

#include <filesystem>

#include "base/descriptor.h"

namespace isomesh::cli {

// A new folder in that for temporary files; the destructor removes it with its content. The folder
// of a run that was killed is removed by the next run: a folder is in use as long as a process
// holds its lock.
class RunFolder {
 public:
  // Throws Error kInvalidParameter with the reason if no folder can be made.
  RunFolder();
  ~RunFolder();
  RunFolder(const RunFolder&) = delete;
  RunFolder& operator=(const RunFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  // For a process that uses the folder and may outlive this one.
  const Descriptor& lock() const { return lock_; }

 private:
  std::filesystem::path path_;
  Descriptor lock_;
};

}  // namespace isomesh::cli
