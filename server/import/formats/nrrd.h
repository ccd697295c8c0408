// NRRD headers (https://teem.sourceforge.net/nrrd/format.html).
#pragma once

#include <string_view>

#include "base/files.h"
#include "server/import/source.h"

namespace isomesh::import {

bool is_nrrd(std::string_view head);

// Reads the header, attached to its samples or in a file of its own; nrrd_space.h says where the
// samples lie. Throws Error kUnusableVolume.
SourceVolume parse_nrrd(const InputFile& file, const Companions& companions);

}  // namespace isomesh::import
