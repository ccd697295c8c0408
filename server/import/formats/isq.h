// Scanco's ISQ images of micro-CT.
#pragma once

#include <string_view>

#include "base/files.h"
#include "server/import/source/reader.h"
#include "server/import/source/source.h"

namespace isomesh::import {

bool is_isq(std::string_view head);

// Reads the header. Samples stay as stored, neither density nor Hounsfield units; the first slice
// lies at its position in the scanner. Throws Error kUnusableVolume.
SourceVolume parse_isq(const InputFile& file, const Companions& companions,
                       const ImportOptions& options);

}  // namespace isomesh::import
