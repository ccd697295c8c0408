// RT Dose (PS3.3, C.8.8.3): an object with a treatment's dose on its own lattice.
#pragma once

#include <span>

#include "server/import/dicom/geometry/image.h"

namespace isomesh::import::dicom {

bool is_dose(const DataSet& data);

// Sets the positions and the rescale of a dose's frames, which on entry all have the first one's
// plane. Throws Error kUnusableVolume if the object does not define them.
void place_dose(const DataSet& data, std::span<Frame> frames);

}  // namespace isomesh::import::dicom
