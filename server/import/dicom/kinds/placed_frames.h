// Objects whose frames have positions of their own kind: doses, tomograms, mosaics.
#pragma once

#include <cstdint>
#include <span>

#include "server/import/dicom/geometry/image.h"

namespace isomesh::import::dicom {

// RT Dose (PS3.3, C.8.8.3): an object with a treatment's dose on its own lattice.
bool is_dose(const DataSet& data);

// Sets the positions and the rescale of a dose's frames, which on entry all have the first one's
// plane. Throws Error kUnusableVolume if the object does not define them.
void place_dose(const DataSet& data, std::span<Frame> frames);

// The distance of neighbouring frames; negative if they follow one another against the normal.
// Without it the slice thickness, and sets the image's `is_distance_assumed`. 0 if neither is
// known.
double frame_distance(const DataSet& data, Image& image);

// Frames of an object that has one position, such as those of some cone-beam scanners: all have the
// plane of the first on entry. Each follows along the normal in the order of their numbers. Sets
// the image's `has_one_position`, which users have to accept. Throws Error kUnusableVolume if their
// distance is unknown.
void place_along_normal(const DataSet& data, Image& image);

// Reconstructed tomograms of nuclear medicine (PS3.3, C.8.4.15): all slices in one object, with the
// position of the first in the sequence of detectors. True for multi-frame objects.
bool is_tomogram(const DataSet& data);

// The frames of a tomogram, with their positions, numbered from 0, and with the vectors by which
// volumes of one object differ. Sets the image's `is_distance_assumed`, and its `place`
// if it has no position: then the first slice lies transverse at the origin.
//
// Without a distance between the slices they are 1 mm apart, and `is_distance_unknown` is set.
//
// Throws Error kUnusableVolume if the frames are projections.
void place_tomogram(const DataSet& data, std::uint32_t frames, Image& image);

// Frames that hold a volume's slices as tiles, from left to right and top to bottom: mosaics of
// Siemens and grids of United Imaging. True if the object is declared as one. Objects with
// functional groups never are, though scanners keep the word after unfolding them.
bool is_mosaic(const DataSet& data);

// True for a grid of United Imaging. The object itself often has no position then.
bool is_placed_grid(const DataSet& data);

// Replaces the one frame of `image`, whose plane is set, by one frame per tile.
//
// A Siemens mosaic is a square of tiles. Its position is that of a slice as large as the mosaic
// with the centre of the first tile. Its slices follow one another along the normal of the CSA
// header, in either direction, or as in the protocol (csa_header.h). A grid of United Imaging has
// as many rows as it needs, and a position for each slice.
//
// Throws Error kUnusableVolume if the object does not define the number and the positions of the
// slices, or if the tiles do not fit its size.
void unfold_mosaic(const DataSet& data, Image& image);

}  // namespace isomesh::import::dicom
