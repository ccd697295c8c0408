// Streams a ZIP to a sink. Private to this folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "server/codec/encode.h"

namespace isomesh::codec {

// Files have no times, so equal files give equal bytes. Not thread safe. Its functions rethrow the
// sink's exceptions, and throw Error kInternal if the ZIP library fails. The destructor writes
// nothing if the ZIP is not finished.
class ZipWriter {
 public:
  enum class Compression {
    kStored,    // uncompressed: each file is a byte range of the ZIP
    kDeflated,  // at the fastest level
  };
  // Old readers without ZIP64 support require files below 4 GiB.
  enum class Sizes { kBelow4GiB, kAny };

  ZipWriter(const Sink& sink, Compression compression, Sizes sizes = Sizes::kAny);
  ~ZipWriter();
  ZipWriter(const ZipWriter&) = delete;
  ZipWriter& operator=(const ZipWriter&) = delete;

  // Returns the offset of the file's bytes in the ZIP.
  std::uint64_t add(const std::string& name, std::span<const std::byte> bytes);

  // Begins a file of unknown size: its bytes follow, up to the next file or the end.
  void begin(const std::string& name);
  void write(std::span<const std::byte> bytes);

  void finish();

 private:
  class Library;
  std::unique_ptr<Library> library_;
};

}  // namespace isomesh::codec
