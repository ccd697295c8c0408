#pragma once

#include <filesystem>
#include <string>

#include "base/descriptor.h"

namespace isomesh {

// A folder that is held open. Paths below path() lead into it even after it was renamed, or another
// folder has taken its place. Thread safe.
class HeldFolder {
 public:
  // `place` must exist. Throws Error kNotFound, kUnavailable or kInternal.
  explicit HeldFolder(const std::filesystem::path& place);

  // Leads into the folder in this process only; see for_other_process().
  const std::filesystem::path& path() const { return path_; }

  // True if its place still leads to this folder, and this user may read and write there.
  bool is_at_place() const;

 private:
  const std::filesystem::path place_;
  const Descriptor folder_;
  const std::filesystem::path path_;
};

// The same place for another process: replaces the beginning that HeldFolder::path() gave by the
// folder's present name. Returns other paths unchanged.
std::filesystem::path for_other_process(const std::filesystem::path& path);

}  // namespace isomesh
