// How near smoothed labels come to the solids that their samples were taken from.
#pragma once

#include <vector>

#include "tests/bench/rows.h"
#include "tests/bench/samples.h"

namespace isomesh::bench {

// Both tables have a row for the default of jobs by labels, and one for 10 Laplacian passes with a
// relaxation factor of 0.33 that move nothing farther than half the smallest spacing.

// The shapes at the spacings 1:1:1, 1:1:2, 1:1:3 and 1:1:5: means over some placements, or the
// worst of them. Changes are in percent. Lengths are in samples: of the geometric mean of the
// spacing, and for faces along their own axis, at 3 samples and more from edges.
Json shape_table();

// The volumes of the labels of more than 1 000 voxels beside those of their voxels. The
// segmentations are taken whole and every third slice.
Json volume_table(const std::vector<Samples>& segmentations);

}  // namespace isomesh::bench
