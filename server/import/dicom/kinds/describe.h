// The elements of a DICOM object, whatever kind it is -> how its samples are stored and where each
// frame lies.
#pragma once

#include "server/import/dicom/geometry/image.h"

namespace isomesh::import::dicom {

// Throws Error kUnusableVolume with the reason when the object holds no pixels, fewer than it
// tells, other ones than plain integers, or does not tell where its frames lie.
Image describe_image(const DicomFile& file);

}  // namespace isomesh::import::dicom
