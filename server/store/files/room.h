#pragma once

#include <cstdint>

#include "base/mutex.h"
#include "server/store/blob_store.h"

namespace isomesh::store {

// What all blobs take, those included that are being written, and how much that may be. Thread
// safe.
class Room {
 public:
  // To be called before the first take(). 0: as much as the disk holds.
  void limit(std::uint64_t max_bytes, MakeRoom make);

  // Bytes that are about to be written; has room made for them where there is none. Throws Error
  // kOutOfSpace.
  void take(std::uint64_t bytes);

  // Of so many bytes that were taken, so many are there in the end.
  void settle(std::uint64_t taken, std::uint64_t bytes);

  // Bytes that are not there any more.
  void give(std::uint64_t bytes);

  // So many bytes are there, whoever has stored them.
  void recount(std::uint64_t bytes);

  std::uint64_t used() const;
  std::uint64_t max_bytes() const { return max_bytes_; }

 private:
  bool try_take(std::uint64_t bytes);

  std::uint64_t max_bytes_ = 0;
  MakeRoom make_;
  mutable Mutex mutex_;
  std::uint64_t used_ ISOMESH_GUARDED_BY(mutex_) = 0;
};

}  // namespace isomesh::store
