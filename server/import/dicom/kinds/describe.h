// The elements of a DICOM object of any kind -> the layout of its samples and the geometry of its
// frames.
#pragma once

#include <optional>
#include <string>

#include "server/import/dicom/elements/dataset.h"
#include "server/import/dicom/geometry/image.h"

namespace isomesh::import::dicom {

// Throws Error kUnusableVolume with the reason if the object has no pixels, fewer than declared, or
// an unsupported type of samples, or if it does not define its frames' positions.
Image describe_image(const DicomFile& file);

// The reason to ignore an object that lies beside a volume but is not part of it: raw data, a
// report, a localiser, ... Empty if it may be an image.
std::optional<std::string> reason_to_ignore(const DicomFile& file);

}  // namespace isomesh::import::dicom
