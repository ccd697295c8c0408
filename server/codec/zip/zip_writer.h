// ZIPs whose bytes go to a sink as they are made; private to this folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "server/codec/encode.h"

namespace isomesh::codec {

// Files without times, so that the same files make the same bytes. Not thread safe. Its functions
// throw what the sink throws, and Error kInternal when the library that writes ZIPs refuses. One
// that is not finished tells the sink nothing more when it ends.
class ZipWriter {
 public:
  enum class Compression {
    kStored,    // as they are, so that each file is a range of the ZIP's bytes
    kDeflated,  // at the fastest level
  };
  // Readers that know ZIPs of old alone read those whose files have less than 4 GiB each.
  enum class Sizes { kBelow4GiB, kAny };

  ZipWriter(const Sink& sink, Compression compression, Sizes sizes = Sizes::kAny);
  ~ZipWriter();
  ZipWriter(const ZipWriter&) = delete;
  ZipWriter& operator=(const ZipWriter&) = delete;

  // Returns where in the ZIP the file's bytes begin.
  std::uint64_t add(const std::string& name, std::span<const std::byte> bytes);

  // A file of unknown size: its bytes follow, up to the next file or the end.
  void begin(const std::string& name);
  void write(std::span<const std::byte> bytes);

  void finish();

 private:
  class Library;
  std::unique_ptr<Library> library_;
};

}  // namespace isomesh::codec
