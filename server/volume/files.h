// Files as the importers need them: read anywhere, write in order, gone when no longer needed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <utility>

namespace isomesh::volume {

// Closes a file descriptor; -1 is none.
class Descriptor {
 public:
  explicit Descriptor(int number = -1) : number_(number) {}
  ~Descriptor();
  Descriptor(Descriptor&& other) noexcept;
  Descriptor& operator=(Descriptor&& other) noexcept;
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  int number() const { return number_; }
  int release() { return std::exchange(number_, -1); }

 private:
  int number_;
};

// A file that is only read. Safe to read from several threads.
class InputFile {
 public:
  // Throws Error kInternal when it cannot be opened or is no regular file.
  explicit InputFile(const std::filesystem::path& path);

  std::uint64_t size() const { return size_; }
  int descriptor() const { return file_.number(); }

  // Reads up to `target.size()` bytes from `offset` on; fewer only at the file's end. Returns how
  // many. Throws Error kInternal when the disk fails.
  std::size_t read(std::uint64_t offset, std::span<std::byte> target) const;

  // The bytes from `offset` on, at most `count` of them.
  std::string text(std::uint64_t offset, std::size_t count) const;

 private:
  Descriptor file_;
  std::uint64_t size_ = 0;
};

// Writes all of `bytes`. Throws Error kOutOfSpace or kInternal.
void write_all(const Descriptor& file, std::span<const std::byte> bytes);

// A temporary file with a name of its own, removed at the end of its life. Not thread safe.
class ScratchFile {
 public:
  // Throws Error kOutOfSpace or kInternal.
  ScratchFile(const std::filesystem::path& folder, std::string_view suffix);
  ~ScratchFile();
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;

  const std::filesystem::path& path() const { return path_; }

  // Appends. Throws Error kOutOfSpace or kInternal.
  void write(std::span<const std::byte> bytes);

 private:
  std::filesystem::path path_;
  Descriptor file_;
};

// Throws what a failed system call means: kOutOfSpace for a full disk or quota, otherwise kInternal
// with the call's name and `error_number`'s text. Never names a path.
[[noreturn]] void throw_system_error(std::string_view call, int error_number);

}  // namespace isomesh::volume
