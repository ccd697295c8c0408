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

// The samples of a gzipped little-endian NIfTI-1 file of uint8 with three dimensions; the geometry
// is always the identity. Throws std::runtime_error with the file's name if it is missing or of
// another kind.
SampleVolume<std::uint8_t> read_nifti_samples(const std::filesystem::path& path);

}  // namespace isomesh::test
