// MetaImage headers (https://itk.org/Wiki/ITK/MetaIO/Documentation), attached to their samples or
// in files of their own.
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

// Reads the header. Its space is taken for LPS, as all programs that write MetaImage have it.
// AnatomicalOrientation and CenterOfRotation, which say the same once more or nothing of the
// samples' places, are passed over. Throws Error kUnusableVolume.
// A slope and offset of the samples are applied, with a note. The options choose one of several
// volumes.
SourceVolume parse_metaimage(const InputFile& file, const Companions& companions,
                             const ImportOptions& options);

// The data files that a header without samples names.
std::vector<std::string> metaimage_data_names(const InputFile& file, const Companions& companions);

// As the header in its beginning tells. Throws as parse_metaimage does, and Error kTooLarge beyond
// the limits.
MostBytes most_metaimage_bytes(const InputFile& beginning, const ImportTask& task);

}  // namespace isomesh::import
