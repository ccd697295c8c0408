#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "base/mutex.h"
#include "server/store/files/blob_store.h"

namespace isomesh::store {

// Copies of blobs on this machine's disk, up to so many bytes: those that were not used for longest
// go first, and none that is in use or was so last. So it may take more for as long as these do. A
// copy is never truth: it may be gone, or be of what no record names any more. Thread safe.
class BlobCache {
 public:
  // Takes over what an earlier life has left; its bytes are checked when they are asked for.
  BlobCache(const BlobFolders& folders, Reserve& reserve, std::uint64_t most_bytes);

  // The copies; whoever adds one keeps it in use from before, and tells of it by note().
  const FileBlobStore& files() const { return files_; }

  // The blob is in use until that is let go, whether there is a copy of it or not.
  std::shared_ptr<const void> use(const std::string& key) const;

  void note(const std::string& key, std::uint64_t bytes) const;

  // Those that have it open keep what they have.
  void erase(const std::string& key) const;

  // Lets copies go until so many bytes more fit, as far as they are not in use.
  void make_room(std::uint64_t bytes) const;

  // Lets all go that are not in use.
  void empty() const;

  // Lets those go of which nobody says that they are to stay, and that are not in use.
  void keep_only(const std::function<bool(const std::string& key)>& stays) const;

  std::uint64_t bytes() const;

 private:
  struct Copy {
    std::uint64_t bytes = 0;  // 0: there may be none
    std::uint64_t last_use = 0;
    std::size_t uses = 0;  // at the same time
  };

  void let_go(const std::string& key) const;
  void shrink_to(std::uint64_t most_bytes, const std::string& but_for = {}) const
      ISOMESH_REQUIRES(mutex_);
  void remove(const std::string& key, Copy& copy) const ISOMESH_REQUIRES(mutex_);

  const FileBlobStore files_;
  const std::uint64_t most_bytes_;
  mutable Mutex mutex_;
  mutable std::map<std::string, Copy> copies_ ISOMESH_GUARDED_BY(mutex_);
  mutable std::uint64_t bytes_ ISOMESH_GUARDED_BY(mutex_) = 0;
  mutable std::uint64_t uses_ ISOMESH_GUARDED_BY(mutex_) = 0;  // so far
};

}  // namespace isomesh::store
