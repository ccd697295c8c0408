#pragma once

#include <cstdint>
#include <functional>

#include "base/mutex.h"

namespace isomesh::store {

// What all blobs take, those included that are being written, and how much that may be. Thread
// safe.
class Room {
 public:
  // Makes room for so many bytes, or throws Error kOutOfSpace.
  using Make = std::function<void(std::uint64_t bytes)>;

  // To be called before the first take(). 0: as much as the disk holds.
  void limit(std::uint64_t max_bytes, Make make);

  // Bytes that are about to be written; has room made for them where there is none. Throws Error
  // kOutOfSpace.
  void take(std::uint64_t bytes);

  // Of so many bytes that were taken, so many are there in the end.
  void settle(std::uint64_t taken, std::uint64_t bytes);

  // Bytes that are not there any more.
  void give(std::uint64_t bytes);

  std::uint64_t used() const;
  std::uint64_t max_bytes() const { return max_bytes_; }

 private:
  bool try_take(std::uint64_t bytes);

  std::uint64_t max_bytes_ = 0;
  Make make_;
  mutable Mutex mutex_;
  std::uint64_t used_ ISOMESH_GUARDED_BY(mutex_) = 0;
};

}  // namespace isomesh::store
