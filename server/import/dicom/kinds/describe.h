// The elements of a DICOM object of any kind -> the layout of its samples and the geometry of its
// frames.
#pragma once

#include "server/import/dicom/geometry/image.h"

namespace isomesh::import::dicom {

// Throws Error kUnusableVolume with the reason if the object has no pixels, fewer than declared, or
// an unsupported type of samples, or if it does not define its frames' positions.
Image describe_image(const DicomFile& file);

}  // namespace isomesh::import::dicom
