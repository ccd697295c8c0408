// Raw samples, which a request describes.
#pragma once

#include <filesystem>

#include "server/volume/import.h"

namespace isomesh::volume {

// Throws Error kInvalidParameter for a description that is none of a volume, kTooLarge for one
// beyond the limits. Needs no file.
void check_raw(const RawDescription& description, const ImportLimits& limits);

// As import_volume. Throws Error kInvalidParameter also when the body's size is not what the
// description tells.
Volume import_raw(const std::filesystem::path& source, const RawDescription& description,
                  const ImportLimits& limits, const std::filesystem::path& target);

}  // namespace isomesh::volume
