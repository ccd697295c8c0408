// A local file that is replaced atomically. Errors are Error kInvalidParameter with the file's
// name, which the caller chose, or kOutOfSpace.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>

#include "base/descriptor.h"
#include "client/isomesh/client.h"

namespace isomesh {

// A new file that replaces `target` when it is published; without that nothing remains. It has no
// name until then, so nothing remains of a process that was killed either. On file systems without
// such files it has a temporary name beside `target`; those that nobody has written to for a day
// are removed. Follows links. The constructor rejects an existing target that is not a regular
// file. With Existing::kRefuse it rejects every target that exists, links too, and so does
// publish().
class PartFile {
 public:
  enum class Until { kUnnamed, kNamed };

  // `until`: kNamed as on a file system without unnamed files, for tests.
  explicit PartFile(const std::filesystem::path& target, Until until = Until::kUnnamed,
                    Existing existing = Existing::kReplace);
  ~PartFile();
  PartFile(const PartFile&) = delete;
  PartFile& operator=(const PartFile&) = delete;

  void write(std::string_view bytes);

  void restart();

  // Syncs the bytes to disk. publish() does so, too; with this, several files appear together.
  void sync();

  // Syncs, then gives the file its name. Call once, last.
  void publish();

 private:
  bool link_to(const std::filesystem::path& path) const;
  bool rename_to_target() const;

  std::filesystem::path target_;
  Existing existing_;
  Descriptor file_;
  std::filesystem::path part_;  // its temporary name; empty if it has none
};

}  // namespace isomesh
