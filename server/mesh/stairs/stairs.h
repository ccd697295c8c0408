// The walls between labels without the steps of voxels, and with the labels' own volumes.
//
// A segmentation says of each voxel which label it has, so the walls between labels are staircases:
// smoothing that takes the steps away takes volume from everything that is round. Here smoothing is
// light, and then each wall gets back what it lacks of its voxels' volume (missing_volume.h), where
// it lacks it:
//  1. A staircase is where convex and concave bends lie close together. Faces along the lattice and
//     plain edges are none and stay where they are; and so do places where junctions of three walls
//     crowd together, as noise makes them.
//  2. What is a staircase is smoothed by exp(-t (1 - mean of the neighbours)), where the spacing is
//     uneven by as much as the wall needs in its direction.
//  3. The missing volume is spread within each wall and put back as an offset along the wall's
//     normal; so the sum over a wall is kept to first order.
//  4. Curves where walls meet are smoothed along themselves, short closed ones less, and then stay;
//     walls get their volume back again, and triangles that fold over are straightened.
// Neighbours share their walls after it as they did before, and what a vertex becomes depends only
// on what is within a distance of it.
#pragma once

#include <limits>

#include "server/mesh/context.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/lattice/lattice.h"
#include "server/mesh/smooth/smooth.h"

namespace isomesh::mesh {

// Moves the vertices of walls that extract_walls has just made with that lattice and options;
// meant for options.regularize, whose vertices are spread evenly. None is moved farther than
// `max_displacement_mm`. Caps stay flat, the ends of walls in the border of the volume stay in it,
// and the rest of walls stays within it. The result does not depend on the number of threads. For
// the six integer types of SampleType. Throws Error kCancelled; the positions are indeterminate
// then.
template <class T>
SmoothingEffect remove_stairs(const Lattice<T>& lattice, const SeparateOptions& options,
                              double max_displacement_mm, const Context& context,
                              SeparatingSurface& surface);

// An upper estimate of what remove_stairs takes beside the surface, in bytes.
std::uint64_t stairs_memory(const SurfaceSize& size);

}  // namespace isomesh::mesh
