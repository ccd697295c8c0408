#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include "base/mutex.h"

namespace isomesh::store {

// Bytes that need space, and whose they will be.
struct Incoming {
  std::string owner = {};
  std::uint64_t bytes = 0;
  // Further bytes of the owner that are being written, so no record names them yet.
  std::uint64_t unfinished = 0;
};
// Frees space for the bytes, or throws Error kOutOfSpace.
using MakeRoom = std::function<void(const Incoming& incoming)>;

// Counts the bytes of all blobs, including those being written, and enforces their limit. Thread
// safe.
class Room {
 public:
  // Call before the first take(). 0: no limit but the disk.
  void limit(std::uint64_t max_bytes, MakeRoom make);

  // Takes room for bytes to be written for `owner`; lets `make` free space if necessary. They are
  // unfinished until finish(). Throws Error kOutOfSpace.
  void take(std::uint64_t bytes, const std::string& owner);

  // Records name the bytes now, or they are given back.
  void finish(std::uint64_t bytes, const std::string& owner);

  // Replaces `taken` bytes by the `bytes` that were stored in the end.
  void correct(std::uint64_t taken, std::uint64_t bytes);

  // Gives back the bytes of removed files.
  void give(std::uint64_t bytes);

  // Sets the count, for example after other daemons stored blobs.
  void recount(std::uint64_t bytes);

  std::uint64_t used() const;
  // The limit on a disk of that size.
  std::uint64_t capacity(std::uint64_t disk) const {
    return max_bytes_ == 0 ? disk : std::min(disk, max_bytes_);
  }

 private:
  bool try_take(std::uint64_t bytes, const std::string& owner);
  std::uint64_t unfinished(const std::string& owner) const;

  std::uint64_t max_bytes_ = 0;
  MakeRoom make_;
  mutable Mutex mutex_;
  std::uint64_t used_ ISOMESH_GUARDED_BY(mutex_) = 0;
  std::map<std::string, std::uint64_t> unfinished_ ISOMESH_GUARDED_BY(mutex_);  // by owner
};

}  // namespace isomesh::store
