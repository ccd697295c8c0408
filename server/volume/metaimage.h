// MetaImage headers (https://itk.org/Wiki/ITK/MetaIO/Documentation), attached to their samples or
// in files of their own.
#pragma once

#include <filesystem>
#include <string_view>

#include "server/volume/source.h"

namespace isomesh::volume {

bool is_metaimage(std::string_view head);

// Reads the header. What it says about space is read by ITK, which takes it for LPS, as all
// programs that write MetaImage do. Throws Error kUnusableVolume.
SourceVolume parse_metaimage(const InputFile& file, const Companions& companions,
                             const std::filesystem::path& scratch);

}  // namespace isomesh::volume
