// Gaussian cube files (https://gaussian.com/cubegen/).
#pragma once

#include <string_view>

#include "base/files.h"
#include "server/import/source/reader.h"
#include "server/import/source/source.h"

namespace isomesh::import {

// Recognises the numbers behind the two lines of comment.
bool is_cube(std::string_view head);

// Reads the header and skips the atoms. Coordinates become angstrom, with a note. The options
// select one of several values or orbitals at each point. Throws Error kUnusableVolume.
SourceVolume parse_cube(const InputFile& file, const Companions& companions,
                        const ImportOptions& options);

}  // namespace isomesh::import
