// Compressed frames -> samples: RLE here, JPEG, JPEG-LS and JPEG 2000 by GDCM.
#pragma once

#include <cstddef>
#include <span>
#include <string_view>

#include "server/import/dicom/geometry/image.h"

namespace isomesh::import::dicom {

// True for the supported transfer syntaxes.
bool can_decode(std::string_view transfer_syntax);

// Decodes one frame into `target`, which has layout.frame_bytes() bytes, little-endian. Compares
// the size in the code stream with the layout before decoding. Throws Error kUnusableVolume with
// the reason, a clause without a subject: "its ...".
void decode_frame(std::string_view transfer_syntax, std::span<const std::byte> compressed,
                  const PixelLayout& layout, std::span<std::byte> target);

}  // namespace isomesh::import::dicom
