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

// Local copies of remote blobs. If they exceed the limit, the least recently used are removed,
// except those in use and the last one used; so the limit may be exceeded while they are. A copy
// may be missing, or belong to a blob that no record names any more. Thread safe.
class BlobCache {
 public:
  // Adopts the copies of an earlier process; they are verified when used.
  BlobCache(const BlobFolders& folders, Reserve& reserve, std::uint64_t most_bytes);

  // The copies. To add one, hold use() from before, then call note().
  FileBlobStore& files() { return files_; }

  // Marks the blob as in use until the result is released, even if there is no copy.
  std::shared_ptr<const void> use(const std::string& key);

  void note(const std::string& key, std::uint64_t bytes);

  // Open readers stay valid.
  void erase(const std::string& key);

  // Removes unused copies until `bytes` more fit.
  void make_room(std::uint64_t bytes);

  // Removes all copies that are not in use.
  void empty();

  // Removes copies for which `stays` returns false, unless they are in use.
  void keep_only(const std::function<bool(const std::string& key)>& stays);

 private:
  struct Copy {
    std::uint64_t bytes = 0;  // 0: there may be no copy
    std::uint64_t last_use = 0;
    std::size_t uses = 0;  // current users
  };

  void let_go(const std::string& key);
  void shrink_to(std::uint64_t most_bytes, const std::string& but_for = {})
      ISOMESH_REQUIRES(mutex_);
  void remove(const std::string& key, Copy& copy) ISOMESH_REQUIRES(mutex_);

  FileBlobStore files_;
  const std::uint64_t most_bytes_;
  Mutex mutex_;
  std::map<std::string, Copy> copies_ ISOMESH_GUARDED_BY(mutex_);
  std::uint64_t bytes_ ISOMESH_GUARDED_BY(mutex_) = 0;
  std::uint64_t uses_ ISOMESH_GUARDED_BY(mutex_) = 0;  // counter of uses
};

}  // namespace isomesh::store
