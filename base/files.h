// Files for random reads, files for sequential writes, and temporary files.
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

// A regular file, opened for reading. Safe to read from several threads.
class InputFile {
 public:
  // Throws Error kInternal or kNotFound if it cannot be opened or is not a regular file.
  explicit InputFile(const std::filesystem::path& path);

  // Takes a file that is open for reading. Throws Error kInternal if it is not a regular file.
  explicit InputFile(Descriptor file) : InputFile(std::move(file), "") {}

  // For a file that a person chose: all errors, also later ones, are Error kInvalidParameter and
  // name the file.
  static InputFile chosen(const std::filesystem::path& path);

  // The size on opening.
  std::uint64_t size() const { return size_; }
  int descriptor() const { return file_.number(); }

  // Reads up to `target.size()` bytes from `offset`; fewer only at the end of the file. Returns
  // their number. Throws Error kInternal if reading fails.
  std::size_t read(std::uint64_t offset, std::span<std::byte> target) const;

  // Fills `target`. Throws Error kInternal also if the file ends early, because it was truncated
  // meanwhile.
  void read_exactly(std::uint64_t offset, std::span<std::byte> target) const;

  // Returns at most `count` bytes from `offset`.
  std::string text(std::uint64_t offset, std::size_t count) const;

 private:
  InputFile(const std::filesystem::path& path, std::string shown);
  InputFile(Descriptor file, std::string shown);
  void look();
  [[noreturn]] void fail(std::string_view call, int error_number) const;

  std::string shown_;  // the file's name in messages; empty: not named
  Descriptor file_;
  std::uint64_t size_ = 0;
};

// A temporary file with a unique name, removed by the destructor. Not thread safe.
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

// True if both files hold the same bytes. Throws as InputFile does.
bool same_bytes(const std::filesystem::path& one, const std::filesystem::path& other);

// The file's whole text. Throws Error kNotFound or kInternal.
std::string read_whole(const std::filesystem::path& path);

// The place that `path` leads to if it is a symbolic link, or a chain of them; else `path`. The
// last link may lead to a file that does not exist. For files that are replaced by renaming, which
// would replace the link. Throws Error kInvalidParameter for a loop.
std::filesystem::path behind_links(const std::filesystem::path& path);

}  // namespace isomesh
