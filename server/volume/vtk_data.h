// The samples of VTK's XML files in their binary forms.
#pragma once

#include <cstdint>

#include "server/volume/files.h"
#include "server/volume/source.h"

namespace isomesh::volume {

// Decodes the array that begins at `range` into `target`: `bytes` of it, which its own header must
// tell, too. Throws Error kUnusableVolume when it is damaged, ends early or tells otherwise.
void decode_vtk(const InputFile& file, const CompressedRange& range, std::uint64_t bytes,
                const VtkEncoding& encoding, const std::filesystem::path& scratch,
                ScratchFile& target);

}  // namespace isomesh::volume
