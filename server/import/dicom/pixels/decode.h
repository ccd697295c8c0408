// Compressed frames -> samples: RLE and deflated frames here, JPEG, JPEG-LS and JPEG 2000 by GDCM,
// JPEG XL by libjxl.
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

// Decodes a frame of single bits into a byte of 0 or 1 for each sample. Plain, RLE and deflated
// frames hold the bits packed, from the lowest of each byte (PS3.5, 8.2), or, in files of some
// programs, a byte for each. The JPEG family has a sample for each, which is set unless it is 0.
// Throws as decode_frame does.
void decode_bits(std::string_view transfer_syntax, std::span<const std::byte> compressed,
                 const PixelLayout& layout, std::span<std::byte> target);

}  // namespace isomesh::import::dicom
