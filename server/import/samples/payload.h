// Encoded samples of a file -> their plain bytes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "base/files.h"
#include "server/import/source/source.h"

namespace isomesh::import {

// The plain bytes of the chosen volume's samples. They lie in the file that they came in where they
// are plain and in one piece there, otherwise in a scratch file, which is removed with this object.
// Bytes decoded from text are little-endian.
class Payload {
 public:
  // Throws Error kUnusableVolume when the file holds fewer samples than its header tells, or when
  // encoded samples are more or cannot be decoded. Never writes more bytes than the header's
  // samples take up. `file` must outlive the payload.
  Payload(const InputFile& file, const SourceVolume& volume, const std::filesystem::path& scratch);

  const InputFile& file() const { return decoded_ ? *decoded_ : file_; }
  std::uint64_t offset() const { return offset_; }
  const SampleLayout& layout() const { return layout_; }
  // What was found while the bytes were looked for.
  const std::vector<Note>& notes() const { return notes_; }

 private:
  void decode(const SourceVolume& volume, const std::filesystem::path& scratch);
  void pick_interleaved(const SourceVolume& volume, const std::filesystem::path& scratch);

  const InputFile& file_;
  std::optional<ScratchFile> scratch_;
  std::optional<ScratchFile> picked_;
  std::optional<InputFile> decoded_;
  std::uint64_t offset_ = 0;
  SampleLayout layout_;
  std::vector<Note> notes_;
};

}  // namespace isomesh::import
