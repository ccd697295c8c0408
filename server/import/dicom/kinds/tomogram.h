// Reconstructed tomograms of nuclear medicine (PS3.3, C.8.4.15): all slices in one object, with the
// position of the first in the sequence of detectors.
#pragma once

#include <span>

#include "server/import/dicom/geometry/image.h"

namespace isomesh::import::dicom {

// True for multi-frame objects of nuclear medicine.
bool is_tomogram(const DataSet& data);

// The frames of a tomogram, with their positions, numbered from 0, and with the vectors by which
// volumes of one object differ. Sets the image's `is_distance_assumed`, and its `place`
// if it has no position: then the first slice lies transverse at the origin.
//
// Throws Error kUnusableVolume if the frames are projections, or if their spacing is unknown.
void place_tomogram(const DataSet& data, std::uint32_t frames, Image& image);

}  // namespace isomesh::import::dicom
