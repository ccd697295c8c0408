// A copy of a data folder, made while a daemon uses it, and put back.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace isomesh::store {

struct Copied {
  std::uint64_t blobs = 0;           // files of volumes and meshes
  std::uint64_t bytes = 0;           // of them
  std::vector<std::string> damaged;  // whose bytes are not what their name says: "the volume ID"
  std::vector<std::string> missing;  // whose files are not there: "a mesh of the job ID"

  bool operator==(const Copied&) const = default;
};

// Copies all volumes, meshes and records of `data` to `target`, which must not exist, as they were
// at one moment of the run. Whoever uses `data` is neither stopped nor waited for. `target` appears
// when all of it is on the disk. Throws Error kInvalidParameter where `data` is no data folder or
// `target` is there, kUnavailable when too much changed meanwhile, kOutOfSpace or kInternal.
Copied back_up(const std::filesystem::path& data, const std::filesystem::path& target);

// Copies what back_up made to `data`, which must be missing or empty. Where root does that, the
// files belong to whom an empty `data` belonged. No daemon starts there before it is whole, also
// where this was killed; where it fails, `data` is as before. Throws as back_up.
Copied restore(const std::filesystem::path& backup, const std::filesystem::path& data);

}  // namespace isomesh::store
