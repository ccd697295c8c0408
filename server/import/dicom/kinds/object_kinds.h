// DICOM objects that lie beside a volume but are not part of it.
#pragma once

#include <optional>
#include <string>

#include "server/import/dicom/elements/dataset.h"

namespace isomesh::import::dicom {

// The reason to ignore an object: raw data, a report, a localiser, ... Empty if it may be an image.
std::optional<std::string> reason_to_ignore(const DicomFile& file);

}  // namespace isomesh::import::dicom
