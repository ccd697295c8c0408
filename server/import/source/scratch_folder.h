#pragma once

#include <cerrno>
#include <filesystem>
#include <string>
#include <string_view>

#include <stdlib.h>

#include "base/error.h"

namespace isomesh::import {

// A folder within `scratch`. The destructor removes it and its content. Not thread safe.
class TemporaryFolder {
 public:
  // Throws Error kOutOfSpace or kInternal.
  TemporaryFolder(const std::filesystem::path& scratch, std::string_view prefix)
      : path_((scratch / (std::string(prefix) + "XXXXXX")).string()) {
    if (::mkdtemp(path_.data()) == nullptr) throw_system_error("mkdtemp", errno);
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

}  // namespace isomesh::import
