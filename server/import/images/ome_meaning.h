// The meaning of an OME-TIFF's pages.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "server/import/images/tiff_meaning.h"

namespace isomesh::import {

// Empty if the text is not OME-XML with images. Images in other files are left out, unless all are.
// Small faults of the text are passed over. Throws Error kUnusableVolume if it is damaged, or this
// file has several images.
std::optional<TiffMeaning> ome_meaning(std::string_view text, std::uint64_t pages);

}  // namespace isomesh::import
