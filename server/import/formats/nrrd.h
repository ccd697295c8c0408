// NRRD headers (https://teem.sourceforge.net/nrrd/format.html).
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/files.h"
#include "server/import/source/reader.h"
#include "server/import/source/source.h"

namespace isomesh::import {

bool is_nrrd(std::string_view head);

// Reads the header, attached or detached; nrrd_space.h reads the geometry. The options select one
// of several volumes along a list or time. Throws Error kUnusableVolume.
SourceVolume parse_nrrd(const InputFile& file, const Companions& companions,
                        const ImportOptions& options);

// The data files of a detached header.
std::vector<std::string> nrrd_data_names(const InputFile& file, const Companions& companions);

// By the header at its beginning. Throws as parse_nrrd does, and Error kTooLarge beyond the limits.
MostBytes most_nrrd_bytes(const InputFile& beginning, const ImportTask& task);

}  // namespace isomesh::import
