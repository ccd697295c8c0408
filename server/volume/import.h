// Uploaded bytes -> canonical volume. What happens here reads untrusted files: the daemon has it
// done by a process of its own (import_runner.h).
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

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

struct ImportTask {
  std::filesystem::path source;   // what was uploaded
  std::filesystem::path scratch;  // a folder for temporary files
  std::filesystem::path target;   // the canonical file to be made, within `scratch`
  ImportOptions options = {};
  ImportLimits limits = {};
};

// Told what is about to be read, as soon as that is known: "nifti", "archive", ...
using FormatListener = std::function<void(std::string_view format)>;

// What an import tells about the volume beside its canonical file; id and created stay empty.
// Throws, for the file's sake: Error kUnsupportedMedia when it is no format that we read, kTooLarge
// when its samples exceed the limits, kUnusableVolume with the reason when it is truncated, corrupt
// or not a volume of finite scalars on a regular three-dimensional lattice, kInvalidParameter when
// it is not what the options say; for the machine's sake: kOutOfSpace, kInternal. Thread safe.
// Nothing but the target stays in the scratch folder; that is the caller's to remove when this
// throws.
Volume import_volume(const ImportTask& task, const FormatListener& listener = {});

}  // namespace isomesh::volume
