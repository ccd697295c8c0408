// MetaImage headers (https://itk.org/Wiki/ITK/MetaIO/Documentation), attached or detached.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/files.h"
#include "server/import/source/reader.h"
#include "server/import/source/source.h"

namespace isomesh::import {

bool is_metaimage(std::string_view head);

// Reads the header. The space is LPS, as in all programs that write MetaImage. Ignores
// AnatomicalOrientation and CenterOfRotation, which do not affect the samples' positions. Applies
// the samples' slope and offset, with a note. The options select one of several volumes. Throws
// Error kUnusableVolume.
SourceVolume parse_metaimage(const InputFile& file, const Companions& companions,
                             const ImportOptions& options);

// The data files of a detached header.
std::vector<std::string> metaimage_data_names(const InputFile& file, const Companions& companions);

// By the header at its beginning. Throws as parse_metaimage does, and Error kTooLarge beyond the
// limits.
MostBytes most_metaimage_bytes(const InputFile& beginning, const ImportTask& task);

}  // namespace isomesh::import
