// Files as those need them who read anywhere, write in order, and leave nothing behind.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "base/descriptor.h"

namespace isomesh {

// A regular file that is only read. Safe to read from several threads.
class InputFile {
 public:
  // Throws Error kInternal or kNotFound when it cannot be opened or is no regular file.
  explicit InputFile(const std::filesystem::path& path);

  // Takes a file that is open for reading. Throws Error kInternal when it is no regular file.
  explicit InputFile(Descriptor file) : InputFile(std::move(file), "") {}

  // The same for a file that a person chose: what goes wrong, now or later, is Error
  // kInvalidParameter that names the file.
  static InputFile chosen(const std::filesystem::path& path);

  // The size when it was opened.
  std::uint64_t size() const { return size_; }
  int descriptor() const { return file_.number(); }

  // Reads up to `target.size()` bytes from `offset` on; fewer only at the file's end. Returns how
  // many. Throws Error kInternal when the disk fails.
  std::size_t read(std::uint64_t offset, std::span<std::byte> target) const;

  // Fills `target`; throws also where the file ends before that, because it was cut meanwhile.
  void read_exactly(std::uint64_t offset, std::span<std::byte> target) const;

  // The bytes from `offset` on, at most `count` of them.
  std::string text(std::uint64_t offset, std::size_t count) const;

 private:
  InputFile(const std::filesystem::path& path, std::string shown);
  InputFile(Descriptor file, std::string shown);
  void look();
  [[noreturn]] void fail(std::string_view call, int error_number) const;

  std::string shown_;  // what messages call it; empty where they must not
  Descriptor file_;
  std::uint64_t size_ = 0;
};

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

// Whether both files hold the same bytes. Throws as InputFile does.
bool same_bytes(const std::filesystem::path& one, const std::filesystem::path& other);

// The file's whole text. Throws Error kNotFound or kInternal.
std::string read_whole(const std::filesystem::path& path);

}  // namespace isomesh
