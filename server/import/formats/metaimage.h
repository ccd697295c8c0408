// MetaImage headers (https://itk.org/Wiki/ITK/MetaIO/Documentation), attached to their samples or
// in files of their own.
#pragma once

#include <cstdint>
#include <string_view>

#include "base/files.h"
#include "server/import/source.h"

namespace isomesh::import {

bool is_metaimage(std::string_view head);

// Reads the header. Its space is taken for LPS, as all programs that write MetaImage have it.
// AnatomicalOrientation and CenterOfRotation, which say the same once more or nothing of the
// samples' places, are passed over. Throws Error kUnusableVolume.
SourceVolume parse_metaimage(const InputFile& file, const Companions& companions);

// How many bytes a compressed file may inflate to: what the header in its beginning describes.
// Throws as parse_metaimage does, and Error kTooLarge beyond the limits.
std::uint64_t most_metaimage_bytes(const InputFile& file, const SizeLimits& limits);

}  // namespace isomesh::import
