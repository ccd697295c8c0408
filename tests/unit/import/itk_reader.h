// ITK's reading of a header, which ours is compared with.
#pragma once

#include <filesystem>
#include <optional>

#include "proto/types.h"

namespace isomesh::import::test {

enum class ItkFormat { kNifti, kNrrd, kMetaImage };

// The geometry that ITK finds, as it finds it: axes beyond the third are left out, those that are
// missing are ITK's defaults. Empty when it refuses the header.
std::optional<Geometry> itk_geometry(ItkFormat format, const std::filesystem::path& path);

}  // namespace isomesh::import::test
