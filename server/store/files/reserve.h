#pragma once

#include <cstdint>
#include <filesystem>

#include "base/mutex.h"

namespace isomesh::store {

// A file that takes up room on the disk, to be let go when there is none left for what frees more:
// removing, cancelling, expiring, starting. Nothing new is begun until it is back. Thread safe.
class Reserve {
 public:
  // Takes `bytes`, or what the file had when that is refused; with 0 bytes there is no reserve.
  // When the disk is full already, the room of an earlier one is let go.
  Reserve(std::filesystem::path file, std::uint64_t bytes);

  // Whether something new may be begun: the reserve is there, or can be taken again, and a little
  // more than that is free.
  bool has_room();

  // Throws Error kOutOfSpace unless has_room().
  void check_room();

  // Gives its room to the disk. False when it had been let go before.
  bool let_go();

  // Bytes that may be written besides, as the disk is now.
  std::uint64_t free_bytes() const;

  // Bytes of the whole disk but for the reserve: what could be written if nothing else were there.
  std::uint64_t capacity() const;

  // What is kept on a disk of the size of this folder's, unless somebody says.
  static std::uint64_t usual_bytes(const std::filesystem::path& folder);

 private:
  bool take() ISOMESH_REQUIRES(mutex_);

  const std::filesystem::path file_;
  const std::uint64_t bytes_;
  Mutex mutex_;
  bool is_whole_ ISOMESH_GUARDED_BY(mutex_) = false;
};

}  // namespace isomesh::store
