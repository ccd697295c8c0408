// What a path stands for as the body of an upload: a file, or several of them as one TAR.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/files.h"
#include "client/isomesh/file.h"

namespace isomesh {

struct PackedFile {
  std::string name;  // within the archive
  std::filesystem::path path;
};

// The files that belong to an upload of `path`: of a folder all regular files below it, without
// links, sorted by name (the server skips what is no part of a volume); of a MetaImage or NRRD
// header (.mhd, .nhdr) it and the files beside it that it names, or that a pattern in it may name;
// of a NIfTI or Analyze header (.hdr) or its image (.img) both; of any other file itself. Throws
// Error kInvalidParameter for a folder without files, or one of more than 20000.
std::vector<PackedFile> files_of_upload(const std::filesystem::path& path);
// The same for several paths that are sent together: all of them as if they lay in one folder.
// Throws also for two files of one name.
std::vector<PackedFile> files_of_upload(const std::vector<std::filesystem::path>& paths);

// A body of known size that is made while it is read, so it is never held whole. The same files
// make the same bytes, whatever their times and owners are.
class UploadBody {
 public:
  // Takes the sizes of all files. Throws Error kInvalidParameter that names a file which cannot be
  // read.
  explicit UploadBody(const std::filesystem::path& path)
      : UploadBody(std::vector<std::filesystem::path>{path}) {}
  explicit UploadBody(const std::vector<std::filesystem::path>& paths);

  std::uint64_t size() const { return size_; }

  // Fills `target` from `offset`. Throws Error kInvalidParameter when a file was cut meanwhile. Not
  // thread safe.
  void read(std::uint64_t offset, std::span<char> target) const;

 private:
  // A run of the body: text of ours, or a whole file.
  struct Part {
    std::uint64_t offset = 0;
    std::uint64_t bytes = 0;
    std::string text;
    std::filesystem::path path;  // empty: it is text
  };

  void add_text(std::string text);
  void add_file(const std::filesystem::path& path, std::uint64_t bytes);
  void add_member(const PackedFile& file);
  void read_part(std::size_t index, std::uint64_t offset, std::span<char> target) const;

  std::vector<Part> parts_;
  std::uint64_t size_ = 0;
  // The file that was read last; bodies are read from their beginning to their end.
  mutable std::size_t open_part_ = 0;
  mutable std::unique_ptr<InputFile> open_file_;
};

}  // namespace isomesh
