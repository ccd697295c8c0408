// Files that appear atomically.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <span>
#include <utility>

#include "base/descriptor.h"

namespace isomesh::store {

// An open file. Its constant methods are thread safe.
class File {
 public:
  // Creates a file that must not exist. Throws Error kOutOfSpace or kInternal.
  static File create(const std::filesystem::path& path);
  // Throws Error kNotFound or kInternal.
  static File open(const std::filesystem::path& path);

  // Writes all bytes, or throws Error kOutOfSpace or kInternal.
  void write(std::span<const std::byte> bytes);

  // Reads up to bytes.size() bytes from `offset`; fewer only at the end of the file.
  std::size_t read_at(std::uint64_t offset, std::span<std::byte> bytes) const;

  // Passes up to `bytes` bytes from `begin` to `take`, block by block. Returns their number; fewer
  // only at the end of the file.
  using Take = std::function<void(std::span<const std::byte> block)>;
  std::uint64_t read(const Take& take, std::uint64_t begin = 0,
                     std::uint64_t bytes = std::numeric_limits<std::uint64_t>::max()) const;

  std::uint64_t size() const;

  // Starts writing cached data to disk; does not wait for the end as sync() does.
  void begin_sync() const;

  // Returns once the data is on disk, not only in the cache. Throws Error kOutOfSpace or kInternal.
  void sync() const;

 private:
  explicit File(Descriptor descriptor) : descriptor_(std::move(descriptor)) {}

  Descriptor descriptor_;
};

// Moves a file within its file system and replaces an existing one. After a crash one of both is
// there, and the new one once sync_folder has returned.
void move_to(const std::filesystem::path& from, const std::filesystem::path& to);

// As move_to, but returns false and changes nothing if `to` exists.
bool move_to_free_place(const std::filesystem::path& from, const std::filesystem::path& to);

// Size in bytes; 0 if the file is missing.
std::uint64_t size_of(const std::filesystem::path& file);

// Sets a file's time to the exact present; the times of written files are coarser. Does nothing if
// the file is missing.
void touch(const std::filesystem::path& file);

// Creates and removes a file in a folder. True if that works, or fails only for lack of space or
// descriptors.
bool can_write_in(const std::filesystem::path& folder);

// Makes new names and renames in a folder survive a crash.
void sync_folder(const std::filesystem::path& folder);

}  // namespace isomesh::store
