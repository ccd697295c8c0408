// The files that a run reads and writes: no mesh replaces a volume or another mesh. Private to this
// folder.
#pragma once

#include <filesystem>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <sys/types.h>

#include "client/cli/batch.h"
#include "client/cli/options.h"

namespace isomesh::cli {

// Every file that the meshes write, as files_of_mesh() names them. A pipe has no materials.
std::vector<std::filesystem::path> files_of(const std::vector<Output>& outputs, bool is_by_labels);

// Thread safe.
class RunFiles {
 public:
  // A file of a mesh that has an owner already: another input, or a volume that the run reads.
  struct Clash {
    std::filesystem::path file;
    std::string owner;  // empty: it is a volume
  };

  // Takes the outputs of all inputs. Throws EarlyExit if two have the same file, or one is a file
  // of a volume.
  RunFiles(const Options& options, const std::vector<Input>& inputs);

  // Takes the outputs of a mesh that is known later, such as that of an archive's member. Takes
  // none of them if there is a clash.
  std::optional<Clash> take(const std::vector<Output>& outputs, const std::string& owner);

 private:
  using FileId = std::pair<dev_t, ino_t>;

  static std::optional<FileId> id_of(const std::filesystem::path& path);
  void add_volume(const std::filesystem::path& path);
  void add_file(const std::filesystem::path& path);

  const bool is_by_labels_;
  std::set<FileId> volumes_;  // links have other names
  std::mutex mutex_;
  std::map<std::filesystem::path, std::string> owners_;
};

}  // namespace isomesh::cli
