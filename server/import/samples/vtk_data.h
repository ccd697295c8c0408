// Binary samples of VTK's XML files.
#pragma once

#include <cstdint>

#include "base/files.h"
#include "server/import/source/source.h"

namespace isomesh::import {

// Decodes the array at the start of `range` into `target`; it must have `bytes` bytes. Throws Error
// kUnusableVolume if it is damaged, truncated or has another size.
void decode_vtk(const InputFile& file, const CompressedRange& range, std::uint64_t bytes,
                const VtkEncoding& encoding, const std::filesystem::path& scratch,
                ScratchFile& target);

}  // namespace isomesh::import
