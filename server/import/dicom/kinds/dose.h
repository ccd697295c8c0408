// RT Dose (PS3.3, C.8.8.3): one object with the dose of a treatment on a lattice of its own.
#pragma once

#include <span>

#include "server/import/dicom/geometry/image.h"

namespace isomesh::import::dicom {

bool is_dose(const DataSet& data);

// Sets the positions and the rescale of a dose's frames, which all have the first one's plane so
// far. Throws Error kUnusableVolume when the object does not tell them.
void place_dose(const DataSet& data, std::span<Frame> frames);

}  // namespace isomesh::import::dicom
