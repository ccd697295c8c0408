// How an object's samples are stored, by its Image Pixel module (PS3.3, C.7.6.3).
#pragma once

#include "server/import/dicom/geometry/image.h"

namespace isomesh::import::dicom {

// As the object tells; 1, 8, 16 and 32 bits, and floating-point numbers of 32 and 64.
// Throws Error kUnusableVolume when the samples are colours, of other sizes, or contradict
// themselves.
PixelLayout pixel_layout(const DicomFile& file);

// Throws Error kUnusableVolume when the object's pixels are not there, are fewer than those of
// `frames`, or are of a transfer syntax that is not read.
void require_pixels(const DicomFile& file, const PixelLayout& layout, std::uint32_t frames);

}  // namespace isomesh::import::dicom
