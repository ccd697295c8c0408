// A file's encoded samples -> plain bytes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "base/files.h"
#include "server/import/source/source.h"

namespace isomesh::import {

// The plain bytes of the selected volume's samples. They stay in the input file if they are plain
// and contiguous there. Otherwise they are in a scratch file, which the destructor removes. Bytes
// decoded from text are little-endian. They are in the file's order (SourceVolume::storage_order).
class Payload {
 public:
  // Throws Error kUnusableVolume if the file has fewer samples than declared, if they cannot be
  // decoded, or if bytes follow that may_trail() does not allow; text and streams may have none.
  // Never writes more bytes than the declared samples have. `file` must outlive the payload.
  Payload(const InputFile& file, const SourceVolume& volume, const std::filesystem::path& scratch);

  const InputFile& file() const { return decoded_ ? *decoded_ : file_; }
  std::uint64_t offset() const { return offset_; }
  const SampleLayout& layout() const { return layout_; }
  const std::vector<Note>& notes() const { return notes_; }

 private:
  void decode(const SourceVolume& volume, const std::filesystem::path& scratch);
  void pick(const SourceVolume& volume, const std::filesystem::path& scratch);
  void pick_interleaved(const SourceVolume& volume, ScratchFile& target);
  void pick_runs(const SourceVolume& volume, ScratchFile& target);

  const InputFile& file_;
  std::optional<ScratchFile> scratch_;
  std::optional<ScratchFile> picked_;
  std::optional<InputFile> decoded_;
  std::uint64_t offset_ = 0;
  SampleLayout layout_;
  std::vector<Note> notes_;
};

}  // namespace isomesh::import
