#pragma once

#include <optional>
#include <string>

#include "server/import/dicom/elements/dataset.h"

namespace isomesh::import::dicom {

// The Recommended Display CIELab Value (PS3.3, C.10.7.1.1) as "#rrggbb" in sRGB, clamped to its
// gamut. Empty if missing.
std::optional<std::string> display_color(const DataSet& data);

}  // namespace isomesh::import::dicom
