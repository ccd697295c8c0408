// The samples of VTK's XML files in their binary forms.
#pragma once

#include <cstdint>

#include "base/files.h"
#include "server/import/source/source.h"

namespace isomesh::import {

// Decodes the array that begins at `range` into `target`. It must have `bytes` bytes. Throws Error
// kUnusableVolume when it is damaged, ends early or has another size.
void decode_vtk(const InputFile& file, const CompressedRange& range, std::uint64_t bytes,
                const VtkEncoding& encoding, const std::filesystem::path& scratch,
                ScratchFile& target);

}  // namespace isomesh::import
