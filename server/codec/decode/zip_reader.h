// The files in a ZIP that is in memory; private to this folder.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "server/codec/decode/formats.h"

namespace isomesh::codec::decoding {

// One after the other, as libarchive reads them, which also checks their sums. Not thread safe; to
// be used and ended by the thread that made it. Throws Error kInternal with what the library says.
class ZipReader {
 public:
  // `format` is that of the whole file, for its errors.
  ZipReader(Bytes file, MeshFormat format);
  ~ZipReader();
  ZipReader(const ZipReader&) = delete;
  ZipReader& operator=(const ZipReader&) = delete;

  // The name of the next file; none behind the last.
  std::optional<std::string> next();

  // The bytes of that file, piece by piece.
  void read(const std::function<void(Bytes)>& take);

 private:
  class Library;
  std::unique_ptr<Library> library_;
};

}  // namespace isomesh::codec::decoding
