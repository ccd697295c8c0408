// Samples as they are encoded in a file -> their plain bytes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "server/volume/files.h"
#include "server/volume/source.h"

namespace isomesh::volume {

// The plain bytes of a volume's samples: in the file that they came in, or decoded or put together
// in a scratch file that lives as long as this. Bytes decoded from text are little-endian.
class Payload {
 public:
  // Throws Error kUnusableVolume when the file holds fewer samples than its header tells, or, where
  // they are encoded, more of them or none that can be decoded. Writes no more than they should
  // take up. `file` must outlive the payload.
  Payload(const InputFile& file, const SourceVolume& volume, const std::filesystem::path& scratch);

  const InputFile& file() const { return decoded_ ? *decoded_ : file_; }
  std::uint64_t offset() const { return offset_; }
  const SampleLayout& layout() const { return layout_; }

 private:
  const InputFile& file_;
  std::optional<ScratchFile> scratch_;
  std::optional<InputFile> decoded_;
  std::uint64_t offset_ = 0;
  SampleLayout layout_;
};

}  // namespace isomesh::volume
