// The lattice on which contours are drawn.
#pragma once

#include <array>
#include <cstdint>

#include "server/import/dicom/contours/structure_set.h"
#include "server/import/source/names.h"

namespace isomesh::import::dicom {

struct ContourGrid {
  std::array<std::uint32_t, 3> dims = {0, 0, 0};
  Geometry geometry;
};

// A lattice of this spacing around all contours, parallel to their planes, with a margin of a
// sample or more. The third axis is the normal of the planes, and some sample has the position of
// the first plane. `spacing` is positive and in mm: along rows, columns and the normal. Throws
// Error kUnusableVolume if a side would have more than 65535 samples.
ContourGrid grid_around(const StructureSet& set, const std::array<double, 3>& spacing);

// The usual distance of the contours' planes along their normal, in mm; empty for a single plane.
std::optional<double> usual_distance(const StructureSet& set);

}  // namespace isomesh::import::dicom
