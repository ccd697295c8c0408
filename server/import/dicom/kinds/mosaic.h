// One frame that holds the slices of a volume as tiles, from left to right and from top to bottom:
// the mosaics of Siemens and the grids of United Imaging.
#pragma once

#include "server/import/dicom/geometry/image.h"

namespace isomesh::import::dicom {

// True for an object that says it is one. Objects with functional groups never are, though scanners
// leave the word in those that they have unfolded.
bool is_mosaic(const DataSet& data);

// Replaces the one frame of `image`, which has its plane, by one for each tile.
//
// A Siemens mosaic is a square of tiles. Its position is that of a slice as large as the mosaic
// with the same centre as the first tile; its slices follow one another along the normal of the CSA
// header, which may point either way. A grid of United Imaging has as many rows as it needs, and
// tells each slice's position.
//
// Throws Error kUnusableVolume when the object does not tell how many slices there are and where
// they lie, or its size is none of so many tiles.
void unfold_mosaic(const DataSet& data, Image& image);

}  // namespace isomesh::import::dicom
