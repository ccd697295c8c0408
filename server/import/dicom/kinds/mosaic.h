// Frames that hold a volume's slices as tiles, from left to right and top to bottom: mosaics of
// Siemens and grids of United Imaging.
#pragma once

#include "server/import/dicom/geometry/image.h"

namespace isomesh::import::dicom {

// True if the object is declared as one. Objects with functional groups never are, though scanners
// keep the word after unfolding them.
bool is_mosaic(const DataSet& data);

// True for a grid of United Imaging. The object itself often has no position then.
bool is_placed_grid(const DataSet& data);

// Replaces the one frame of `image`, whose plane is set, by one frame per tile.
//
// A Siemens mosaic is a square of tiles. Its position is that of a slice as large as the mosaic
// with the centre of the first tile. Its slices follow one another along the normal of the CSA
// header, in either direction, or as in the protocol (ascconv.h). A grid of United Imaging has as
// many rows as it needs, and a position for each slice.
//
// Throws Error kUnusableVolume if the object does not define the number and the positions of the
// slices, or if the tiles do not fit its size.
void unfold_mosaic(const DataSet& data, Image& image);

}  // namespace isomesh::import::dicom
