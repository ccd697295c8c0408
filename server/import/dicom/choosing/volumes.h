// The frames of a series -> the volumes that they make: times, echoes, b-values and the like.
#pragma once

#include <string>
#include <vector>

#include "server/import/dicom/geometry/stack.h"

namespace isomesh::import::dicom {

struct SeriesVolume {
  std::string title;  // what sets it apart: "EchoTime 4.92, 20 slices"
  std::vector<Slice> slices;
  // How many slices the others have, where this one has fewer: it was broken off.
  std::size_t whole_count = 0;
};

struct SeriesVolumes {
  std::string difference;  // by what they differ: "EchoTime"; empty when there is one
  std::vector<SeriesVolume> volumes;
};

// Splits where several frames lie at one position, by the attributes that tell them apart, in
// rising order of their values; where none does, by the order in which the frames were acquired.
// Mosaics are a volume each. Frames of other sizes, spacings and orientations are volumes of their
// own, too. At least two of the volumes of one lattice are whole; a slice that is merely doubled is
// no split.
//
// Nothing is left out: where no split gives every frame its place, all are one volume, and
// make_stack says why that is none.
SeriesVolumes split_volumes(std::vector<Slice> slices);

}  // namespace isomesh::import::dicom
