// Signed distances within a slice, and shapes between two slices.
#pragma once

#include <array>
#include <vector>

#include "server/import/dicom/contours/raster.h"

namespace isomesh::import::dicom {

// The distance of each sample from the nearest sample of the other kind, positive inside. Samples
// beyond the slice count as outside. `spacing` is in mm, along rows and along columns. Exact
// (Felzenszwalb and Huttenlocher, Distance Transforms of Sampled Functions, 2012), in single
// precision. A mask without inside samples has distances below any other.
std::vector<float> signed_distances(const Mask& mask, const std::array<double, 2>& spacing);

// The shape at the share `along` (0 to 1) of the way from one slice to the next: where the
// interpolated signed distance is positive (Raya and Udupa, Shape-based interpolation, 1990).
Mask between(const std::vector<float>& from, const std::vector<float>& to, double along,
             std::uint32_t columns, std::uint32_t rows);

}  // namespace isomesh::import::dicom
