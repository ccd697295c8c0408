// Backs up a data folder in use, and restores it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "server/store/sql/schema.h"

namespace isomesh::store {

struct Copied {
  std::uint64_t blobs = 0;           // files that records name
  std::uint64_t bytes = 0;           // of those files
  std::vector<std::string> damaged;  // with wrong bytes; described as "the volume ID"
  std::vector<std::string> missing;  // without a file; described as "a mesh of the job ID"

  bool operator==(const Copied&) const = default;
};

// Copies all records of `data` and the files that they name (volumes, meshes, received images and
// objects to be sent) to `target`, which must not exist, as of one
// moment during the run. A daemon that uses `data` is neither stopped nor blocked. `target` appears
// once everything is on disk. Throws Error kInvalidParameter if `data` is not a data folder or
// `target` exists; kUnavailable if too much changed meanwhile; kOutOfSpace or kInternal.
Copied back_up(const std::filesystem::path& data, const std::filesystem::path& target);

// Copies a backup to `data`, which must be missing or empty. If root does this, the files get the
// owner of an existing empty `data`. No daemon can start there before the restore is complete, even
// if it was killed. If it fails, `data` is as before. Throws as back_up, and kUnavailable if a
// newer isomeshd made the backup, or one with other components.
Copied restore(const std::filesystem::path& backup, const std::filesystem::path& data,
               const std::vector<Schema>& components);

}  // namespace isomesh::store
