// A local file that is replaced atomically. Errors are Error kInvalidParameter with the file's
// name, which the caller chose, or kOutOfSpace.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>

#include "base/descriptor.h"

namespace isomesh {

// A temporary file beside `target`. `publish` moves it to `target`, replacing an existing file;
// without it nothing remains. Follows links. The constructor rejects an existing target that is not
// a regular file.
class PartFile {
 public:
  explicit PartFile(const std::filesystem::path& target);
  ~PartFile();
  PartFile(const PartFile&) = delete;
  PartFile& operator=(const PartFile&) = delete;

  void write(std::string_view bytes);

  void restart();

  // Syncs the bytes to disk, then moves the file. Call once, last.
  void publish();

 private:
  std::filesystem::path target_;
  std::filesystem::path part_;
  Descriptor file_;
  bool published_ = false;
};

}  // namespace isomesh
