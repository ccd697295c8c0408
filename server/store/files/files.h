// Files that are either whole or not there.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <utility>

#include "base/descriptor.h"

namespace isomesh::store {

// An open file, closed when it goes.
class File {
 public:
  // Throws Error kOutOfSpace or kInternal. The file is created new; it must not exist.
  static File create(const std::filesystem::path& path);
  // Throws Error kNotFound or kInternal.
  static File open(const std::filesystem::path& path);

  // All of `bytes`, or Error kOutOfSpace or kInternal.
  void write(std::span<const std::byte> bytes);

  // Reads up to bytes.size() bytes from `offset`; fewer only at the end of the file.
  std::size_t read_at(std::uint64_t offset, std::span<std::byte> bytes) const;

  std::uint64_t size() const;

  // The disk begins to write what it has not; only sync() tells when that is done.
  void begin_sync() const;

  // To disk, not only to the system. Throws Error kOutOfSpace or kInternal.
  void sync() const;

 private:
  explicit File(Descriptor descriptor) : descriptor_(std::move(descriptor)) {}

  Descriptor descriptor_;
};

// Moves a file within its file system, over what is there. A crash leaves either the one or the
// other there once sync_folder has returned.
void move_to(const std::filesystem::path& from, const std::filesystem::path& to);

// The same where nothing is there; false, and nothing has changed, where something is.
bool move_to_free_place(const std::filesystem::path& from, const std::filesystem::path& to);

// 0 when it is not there.
std::uint64_t size_of(const std::filesystem::path& file);

// Gives a file the present time, which is a finer one than the system gives to what is written.
// Nothing happens when it is not there.
void touch(const std::filesystem::path& file);

// Makes renames and new names in a folder survive a crash.
void sync_folder(const std::filesystem::path& folder);

}  // namespace isomesh::store
