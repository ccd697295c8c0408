// The real volume of the tests: the brain MRI of the Debian package mricron-data.
#pragma once

#include <cstdint>
#include <filesystem>

#include "tests/support/shapes.h"

namespace isomesh::test {

inline constexpr const char* kBrainFile = "/usr/share/mricron/templates/ch2.nii.gz";
inline constexpr double kBrainIso = 60;
// 116 regions of that brain, each a label.
inline constexpr const char* kAtlasFile = "/usr/share/mricron/templates/aal.nii.gz";

// The samples of a gzipped little-endian NIfTI-1 file of uint8 with three dimensions, with the
// identity as geometry whatever the file says. Throws std::runtime_error that names the file when
// it is missing or anything else.
SampleVolume<std::uint8_t> read_nifti_samples(const std::filesystem::path& path);

}  // namespace isomesh::test
