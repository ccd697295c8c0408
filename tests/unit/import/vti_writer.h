// Small .vti files, written plainly and apart from the importer.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace isomesh::import::test {

enum class VtiForm { kAscii, kBinary, kAppendedRaw, kAppendedBase64 };

struct VtiFields {
  VtiForm form = VtiForm::kAppendedRaw;
  std::string type = "UInt8";
  bool big_endian = false;
  bool compressed = false;
  bool wide_header = true;
  std::uint64_t block_bytes = 10;  // small, so that there are several
  std::string extent = "0 3 0 2 0 1";
  std::string piece_extent = {};  // empty: the same
  std::string origin = "0 0 0";
  std::string spacing = "1 1 1";
  std::string direction = "1 0 0 0 1 0 0 0 1";
  std::string components = "1";
  std::string scalars = "samples";
  std::string more = {};  // further arrays of the point data
  std::string kind = "ImageData";
  std::string compressor = {};  // empty: zlib's
};

// `samples` are bytes in the file's byte order, or text for kAscii.
std::string vti(const VtiFields& fields, std::string_view samples);

}  // namespace isomesh::import::test
