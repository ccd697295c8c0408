// RT Dose (PS3.3, C.8.8.3): a treatment's dose on a lattice of its own, all planes in one object.
#pragma once

#include <span>

#include "server/volume/dicom/image.h"

namespace isomesh::volume::dicom {

bool is_dose(const DataSet& data);

// Gives the frames of a dose, which all have the plane of the first, their own positions and the
// scale that makes doses of samples. Throws Error kUnusableVolume when they are not told.
void place_dose(const DataSet& data, std::span<Frame> frames);

}  // namespace isomesh::volume::dicom
