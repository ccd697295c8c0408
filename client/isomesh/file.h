// A file of this machine that appears at once, whole, or not at all. Errors are Error
// kInvalidParameter that name the file (the caller chose it), or kOutOfSpace.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>

#include "base/descriptor.h"

namespace isomesh {

// A file under construction beside `target`. What was written appears at `target`, replacing what
// is there, with `publish`; without it nothing remains. A target that is a link is followed; one
// that is neither a regular file nor absent is refused by the constructor.
class PartFile {
 public:
  explicit PartFile(const std::filesystem::path& target);
  ~PartFile();
  PartFile(const PartFile&) = delete;
  PartFile& operator=(const PartFile&) = delete;

  void write(std::string_view bytes);

  // Forgets what was written.
  void restart();

  // Makes the bytes durable, then visible. Is called once, as the last method.
  void publish();

 private:
  std::filesystem::path target_;
  std::filesystem::path part_;
  Descriptor file_;
  bool published_ = false;
};

}  // namespace isomesh
