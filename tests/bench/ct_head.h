// The CT of a head that Debian's package invesalius-examples ships, for the report.
#pragma once

#include <filesystem>

#include "tests/bench/samples.h"

namespace isomesh::bench {

inline constexpr const char* kCtHeadFile =
    "/usr/share/doc/invesalius-examples/examples/Cranium.inv3";
inline constexpr double kBoneIso = 250;  // Hounsfield units
inline constexpr double kSkinIso = -300;

// Reads a project file of InVesalius: a gzipped tar with main.plist, which tells shape and spacing,
// and matrix.dat, the samples as int16. Only what such a file needs of tar is read. The directions
// are not kept: the volume comes with the identity. Throws std::runtime_error that names the file
// when it is missing or anything else.
Samples read_inv3(const std::filesystem::path& path);

}  // namespace isomesh::bench
