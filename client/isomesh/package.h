// The body of an upload: a file, or several as one TAR.
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
  std::string name;
  std::filesystem::path path;
};

// The files to upload for `path`. Of a folder: all regular files below it, sorted by name (the
// server skips files that are not part of a volume); links are followed, `.git` is left out. Of a
// MetaImage or NRRD header (.mhd, .nhdr): it and the files beside it that it names, or that may
// match its pattern. Of a NIfTI or Analyze header (.hdr) or its image (.img), also gzipped, and of
// AFNI's .HEAD and .BRIK or Philips' .PAR and .REC: both. Of any other file: itself. Throws Error
// kInvalidParameter for a folder without files or with more than 20000, for a link to nothing or to
// a folder around it, and for a path that cannot be looked at.
std::vector<PackedFile> files_of_upload(const std::filesystem::path& path);
// The same for several paths that are sent together, as if in one folder. Throws also for two files
// with the same name.
std::vector<PackedFile> files_of_upload(const std::vector<std::filesystem::path>& paths);

// A body of known size that is generated while it is read, and never held in memory. Equal files
// give equal bytes, regardless of times and owners.
class UploadBody {
 public:
  // Reads the sizes of all files. Throws Error kInvalidParameter with the name of an unreadable
  // file, and for no paths.
  explicit UploadBody(const std::filesystem::path& path)
      : UploadBody(std::vector<std::filesystem::path>{path}) {}
  explicit UploadBody(const std::vector<std::filesystem::path>& paths);

  std::uint64_t size() const { return size_; }

  // Fills `target` from `offset`. Throws Error kInvalidParameter if a file was truncated meanwhile.
  // Not thread safe.
  void read(std::uint64_t offset, std::span<char> target) const;

 private:
  // A range of the body: generated text, or a whole file.
  struct Part {
    std::uint64_t offset = 0;
    std::uint64_t bytes = 0;
    std::string text;
    std::filesystem::path path;  // empty for text
  };

  void add_text(std::string text);
  void add_file(const std::filesystem::path& path, std::uint64_t bytes);
  void add_member(const PackedFile& file);
  void read_part(std::size_t index, std::uint64_t offset, std::span<char> target) const;

  std::vector<Part> parts_;
  std::uint64_t size_ = 0;
  // The last file read; bodies are read sequentially.
  mutable std::size_t open_part_ = 0;
  mutable std::unique_ptr<InputFile> open_file_;
};

}  // namespace isomesh
