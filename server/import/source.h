// What a header says about a volume: all but the samples themselves.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/types.h"
#include "server/import/archives/gzip.h"
#include "server/import/names.h"
#include "server/import/stored_samples.h"

namespace isomesh::import {

enum class Encoding {
  kRaw,
  kDeflate,  // a gzip or zlib stream
  kText,     // numbers between white space
  kHex,      // pairs of hexadecimal digits, white space between them ignored
  kVtk,      // see VtkEncoding
};

// How VTK encodes an array: a header of counts comes first, then its bytes, which may be compressed
// by zlib in blocks; all of it may be in base64.
struct VtkEncoding {
  bool base64 = false;
  bool compressed = false;
  bool wide_header = false;  // counts of 8 bytes instead of 4
  bool big_endian = false;
};

// The other files of the folder in an archive in which a header lies, by their names. A file that
// came alone has none.
using Companions = std::map<std::string, std::filesystem::path, std::less<>>;

// A file that holds samples and no header.
struct DataFile {
  std::filesystem::path path;
  CompressedRange range;
};

struct SourceVolume {
  std::array<std::uint32_t, 3> dims = {0, 0, 0};
  SampleLayout layout;
  Encoding encoding = Encoding::kRaw;
  CompressedRange payload;  // where the samples lie, unless there are data files
  VtkEncoding vtk;          // for Encoding::kVtk
  // Of a header without samples: the files that hold equal parts of them, in this order.
  std::vector<DataFile> data_files;
  Geometry geometry;

  std::uint64_t sample_count() const { return std::uint64_t{dims[0]} * dims[1] * dims[2]; }
  // What the samples take up in the file, once decoded.
  std::uint64_t stored_bytes() const { return sample_count() * bytes_per_sample(layout.type); }
  // What they take up at most as they are encoded, with generous white space.
  std::uint64_t most_encoded_bytes() const;
};

// Throws Error kTooLarge when the volume's canonical samples would exceed the limits.
void check_limits(const SourceVolume& volume, const SizeLimits& limits);

// How many bytes of a data file come before its samples. Empty: as many as there are, so that the
// samples end with the file.
using Skip = std::optional<std::uint64_t>;

// The data files that a header names, in its order. Each holds the same share of `volume`'s
// samples. Throws Error kUnusableVolume for a name that is a path or none of a companion, for a
// file of another size than its share and the skip, and where the samples' place cannot be known.
std::vector<DataFile> data_files_of(const std::vector<std::string>& names,
                                    const Companions& companions, const SourceVolume& volume,
                                    const Skip& skip);

}  // namespace isomesh::import
