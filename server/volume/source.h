// What an adapter tells about a volume in a file: everything but the samples themselves.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>

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
};

struct SourceVolume {
  FileFormat format = FileFormat::kNifti;
  std::array<std::uint32_t, 3> dims = {0, 0, 0};
  SampleLayout layout;
  Encoding encoding = Encoding::kRaw;
  CompressedRange payload;  // where the samples lie; up to the file's end where it says no size
  Geometry geometry;

  std::uint64_t sample_count() const { return std::uint64_t{dims[0]} * dims[1] * dims[2]; }
  // What the samples take up in the file, once decoded.
  std::uint64_t stored_bytes() const { return sample_count() * bytes_per_sample(layout.type); }
};

// Throws Error kUnusableVolume.
[[noreturn]] void throw_unusable(const std::string& reason);

// The three sizes of a volume from all that a header tells: what is missing is 1, what is beyond
// must be 1. Throws Error kUnusableVolume for a size of 0, a series of volumes, or so many samples
// that their bytes cannot be counted.
std::array<std::uint32_t, 3> volume_dims(std::span<const std::uint64_t> sizes);

}  // namespace isomesh::volume
