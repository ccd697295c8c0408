#pragma once

#include <cstdint>
#include <filesystem>

#include "base/mutex.h"

namespace isomesh::store {

// A file that occupies disk space. It is released when the disk is full, so that operations which
// free space (delete, cancel, expire, start) still work. No new work starts until it is back.
// Thread safe.
class Reserve {
 public:
  // Reserves `bytes`; 0 disables the reserve. If the disk is already full, an existing reserve is
  // released.
  Reserve(std::filesystem::path file, std::uint64_t bytes);

  // True if new work may start: the reserve is there, or can be taken again, and some more space is
  // free.
  bool has_room();

  // Throws Error kOutOfSpace unless has_room().
  void check_room();

  // Releases the reserve, unless it was released before.
  void let_go();

  // Bytes free on the disk now, besides the reserve.
  std::uint64_t free_bytes() const;

  // Size of the disk without the reserve and its margin.
  std::uint64_t capacity() const;

  // The default reserve for the disk of this folder.
  static std::uint64_t usual_bytes(const std::filesystem::path& folder);

 private:
  bool take() ISOMESH_REQUIRES(mutex_);

  const std::filesystem::path file_;
  const std::uint64_t bytes_;
  Mutex mutex_;
  bool is_whole_ ISOMESH_GUARDED_BY(mutex_) = false;
};

}  // namespace isomesh::store
