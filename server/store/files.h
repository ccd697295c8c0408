// Files that are either whole or not there, and digests of them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>

namespace isomesh::store {

// An open file descriptor, closed when it goes.
class File {
 public:
  // Throws Error kOutOfSpace or kInternal. The file is created new; it must not exist.
  static File create(const std::filesystem::path& path);
  // Throws Error kNotFound or kInternal.
  static File open(const std::filesystem::path& path);

  File(File&& other) noexcept : descriptor_(other.descriptor_) { other.descriptor_ = -1; }
  File& operator=(File&& other) noexcept;
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  ~File();

  // All of `bytes`, or Error kOutOfSpace or kInternal.
  void write(std::span<const std::byte> bytes);

  // Reads up to bytes.size() bytes from `offset`; fewer only at the end of the file.
  std::size_t read_at(std::uint64_t offset, std::span<std::byte> bytes) const;

  std::uint64_t size() const;

  // To disk, not only to the system. Throws Error kOutOfSpace or kInternal.
  void sync();

 private:
  explicit File(int descriptor) : descriptor_(descriptor) {}

  int descriptor_;
};

// Moves a file within its file system, over what is there.
void move_to(const std::filesystem::path& from, const std::filesystem::path& to);

// Moves a finished, synced file to its place and syncs the folder, so that a crash leaves either
// nothing there or all of it. Both must be on one file system.
void publish(const std::filesystem::path& from, const std::filesystem::path& to);

// Makes renames and new names in a folder survive a crash.
void sync_folder(const std::filesystem::path& folder);

// Writes a small file whole: beside its place, synced, then published. Replaces what was there.
void write_whole(const std::filesystem::path& path, std::string_view text);

// The file's text. Throws Error kNotFound or kInternal.
std::string read_whole(const std::filesystem::path& path);

// SHA-256 of bytes that come piece by piece. Not thread safe.
class Sha256 {
 public:
  static constexpr std::size_t kBytes = 32;

  Sha256();
  ~Sha256();
  Sha256(Sha256&&) noexcept;
  Sha256& operator=(Sha256&&) noexcept;

  void update(std::span<const std::byte> bytes);

  // The digest of all bytes so far; to be called once.
  std::array<std::uint8_t, kBytes> finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// The digest of a text, in hex.
std::string sha256_of(std::string_view text);

std::string to_hex(std::span<const std::uint8_t> bytes);

// Lower-case hexadecimal from the system's random source.
std::string random_hex(std::size_t bytes);

// A name that sorts after all that this process made before: a UUID of version 7 (RFC 9562). Thread
// safe.
std::string time_ordered_id();

// The present time as RFC 3339 in UTC, with milliseconds.
std::string timestamp();

}  // namespace isomesh::store
