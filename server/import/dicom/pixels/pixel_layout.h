// The layout of an object's samples, from its Image Pixel module (PS3.3, C.7.6.3).
#pragma once

#include "server/import/dicom/geometry/image.h"

namespace isomesh::import::dicom {

// Supports 1, 8, 16 and 32 bits, and floating-point numbers of 32 and 64. Throws Error
// kUnusableVolume for colours, other sizes and contradictions.
PixelLayout pixel_layout(const DicomFile& file);

// Throws Error kUnusableVolume if the object has no pixels, fewer than `frames` need, or an
// unsupported transfer syntax.
void require_pixels(const DicomFile& file, const PixelLayout& layout, std::uint32_t frames);

}  // namespace isomesh::import::dicom
