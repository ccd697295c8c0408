// What an adapter tells about a volume in a file: everything but the samples themselves.
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
#include "server/volume/gzip.h"
#include "server/volume/samples.h"
#include "server/volume/sniff.h"

namespace isomesh::volume {

enum class Encoding {
  kRaw,
  kDeflate,  // a gzip or zlib stream
  kText,     // numbers between white space
  kHex,      // pairs of hexadecimal digits, white space between them ignored
  kVtk,      // see VtkEncoding
};

// How VTK writes an array of bytes: behind a header of counts, in base64 or as they are, as a whole
// or in blocks of zlib.
struct VtkEncoding {
  bool base64 = false;
  bool compressed = false;
  bool wide_header = false;  // counts of 8 bytes instead of 4
  bool big_endian = false;
};

// The files that lie beside a volume's in its archive, by their names; none for a file that came
// alone.
using Companions = std::map<std::string, std::filesystem::path, std::less<>>;

// A file that holds samples and no header.
struct DataFile {
  std::filesystem::path path;
  CompressedRange range;
};

struct SourceVolume {
  FileFormat format = FileFormat::kNifti;
  std::array<std::uint32_t, 3> dims = {0, 0, 0};
  SampleLayout layout;
  Encoding encoding = Encoding::kRaw;
  CompressedRange payload;  // where the samples lie; up to the file's end where it says no size
  VtkEncoding vtk;          // for Encoding::kVtk
  // Where they lie instead when the header is detached: in equal parts, in this order.
  std::vector<DataFile> data_files;
  Geometry geometry;

  std::uint64_t sample_count() const { return std::uint64_t{dims[0]} * dims[1] * dims[2]; }
  // What the samples take up in the file, once decoded.
  std::uint64_t stored_bytes() const { return sample_count() * bytes_per_sample(layout.type); }
};

// Throws Error kUnusableVolume.
[[noreturn]] void throw_unusable(const std::string& reason);

// Where a header says that samples begin in a file of their own: so many bytes behind its
// beginning, or, without a number, so that they end with it.
using Skip = std::optional<std::uint64_t>;

// The files that a detached header names, in its order, of which each holds the same share of
// `volume`'s samples. Throws Error kUnusableVolume for names that are not plain ones of companions,
// and for files of which a header cannot tell where the samples lie.
std::vector<DataFile> data_files_of(const std::vector<std::string>& names,
                                    const Companions& companions, const SourceVolume& volume,
                                    const Skip& skip);

// The three sizes of a volume from all that a header tells: what is missing is 1, what is beyond
// must be 1. Throws Error kUnusableVolume for a size of 0, a series of volumes, or so many samples
// that their bytes cannot be counted.
std::array<std::uint32_t, 3> volume_dims(std::span<const std::uint64_t> sizes);

}  // namespace isomesh::volume
