// The lattice on which contours are drawn.
#pragma once

#include <array>
#include <cstdint>

#include "server/import/dicom/contours/structure_set.h"
#include "server/import/source/names.h"

namespace isomesh::import::dicom {

// Contours within this distance of a slice, in slices, are in it. Positions are written with a few
// decimals.
inline constexpr double kSameSlice = 0.1;

struct ContourGrid {
  std::array<std::uint32_t, 3> dims = {0, 0, 0};
  Geometry geometry;
};

// A lattice of this spacing around all contours, parallel to their planes, with a margin of a
// sample or more. The third axis is the normal of the planes, and some sample has the position of
// the first plane. `spacing` is positive and in mm: along rows, columns and the normal. Throws
// Error kUnusableVolume if a side would have more than 65535 samples.
ContourGrid grid_around(const StructureSet& set, const std::array<double, 3>& spacing);

// The images' grid. If all contours are as far from the nearest slice and between slices, the grid
// is moved along its third axis to their planes, with one slice more: so they are drawn where they
// are, and those at the ends keep their thickness.
ContourGrid grid_of_images(const StructureSet& set, const ContourGrid& images);

// The usual distance of the contours' planes along their normal, in mm; empty for a single plane.
std::optional<double> usual_distance(const StructureSet& set);

}  // namespace isomesh::import::dicom
