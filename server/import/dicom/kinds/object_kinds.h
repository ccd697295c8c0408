// Which objects are no part of a volume, though they lie beside one.
#pragma once

#include <optional>
#include <string>

#include "server/import/dicom/elements/dataset.h"

namespace isomesh::import::dicom {

// Why an object is no part of a volume: raw data, a report, a localiser, ... Empty when it may be
// an image.
std::optional<std::string> reason_to_ignore(const DicomFile& file);

}  // namespace isomesh::import::dicom
