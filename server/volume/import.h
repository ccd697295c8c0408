// Uploaded bytes -> canonical volume.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "proto/types.h"

namespace isomesh::volume {

// What a request says about raw samples, which say nothing about themselves.
struct RawDescription {
  std::array<std::uint32_t, 3> dims = {0, 0, 0};
  SampleType type = SampleType::kUint8;
  Geometry geometry;
  bool big_endian = false;
};

struct ImportLimits {
  std::uint64_t max_sample_bytes = std::uint64_t{16} << 30;
};

// What a request says about its body.
struct ImportOptions {
  std::optional<RawDescription> raw;  // empty: the body says itself what it is
  std::string series;                 // UID of the DICOM series to take; empty: the only one
};

// What an import tells about the volume beside its canonical file; id and created stay empty.
// Throws, for the file's sake: Error kUnsupportedMedia when it is no format that we read, kTooLarge
// when its samples exceed the limits, kUnusableVolume with the reason when it is truncated, corrupt
// or not a volume of finite scalars on a regular three-dimensional lattice; for the machine's sake:
// kOutOfSpace, kInternal. Thread safe. `scratch` is a folder for temporary files, `target` the
// canonical file to be made; both are the caller's to remove when this throws. A `series` where
// there is no DICOM is kInvalidParameter.
Volume import_file(const std::filesystem::path& source, const std::string& series,
                   const std::filesystem::path& scratch, const ImportLimits& limits,
                   const std::filesystem::path& target);

// The same for raw samples. Throws Error kInvalidParameter when the body's size is not what the
// description tells.
Volume import_raw(const std::filesystem::path& source, const RawDescription& description,
                  const ImportLimits& limits, const std::filesystem::path& target);

}  // namespace isomesh::volume
