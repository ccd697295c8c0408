// NRRD headers (https://teem.sourceforge.net/nrrd/format.html).
#pragma once

#include <cstdint>
#include <string_view>

#include "base/files.h"
#include "server/import/source.h"

namespace isomesh::import {

bool is_nrrd(std::string_view head);

// Reads the header, attached to its samples or in a file of its own; nrrd_space.h says where the
// samples lie. Throws Error kUnusableVolume.
SourceVolume parse_nrrd(const InputFile& file, const Companions& companions);

// How many bytes a compressed file may inflate to: what the header in its beginning describes.
// Throws as parse_nrrd does, and Error kTooLarge beyond the limits.
std::uint64_t most_nrrd_bytes(const InputFile& file, const SizeLimits& limits);

}  // namespace isomesh::import
