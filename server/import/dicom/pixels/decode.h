// Compressed frames -> samples: RLE here, JPEG, JPEG-LS and JPEG 2000 by GDCM.
#pragma once

#include <cstddef>
#include <span>
#include <string_view>

#include "server/import/dicom/geometry/image.h"

namespace isomesh::import::dicom {

// True for the transfer syntaxes that frames are decoded from.
bool can_decode(std::string_view transfer_syntax);

// Decodes one frame into `target`, which has layout.frame_bytes() bytes, little-endian. What the
// code stream tells about its size is compared with the layout before anything is decoded.
// Throws Error kUnusableVolume with the reason, a clause without a subject: "its ...".
void decode_frame(std::string_view transfer_syntax, std::span<const std::byte> compressed,
                  const PixelLayout& layout, std::span<std::byte> target);

}  // namespace isomesh::import::dicom
