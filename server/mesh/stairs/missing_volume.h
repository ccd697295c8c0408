// How much less the walls between labels enclose than the labels' voxels, and where.
//
// With each vertex at the sample that owns it (VertexOwner), walls are made of faces of the
// lattice, and in a tetrahedron with several parts that with the smallest number has all of it. A
// tetrahedron has a share of the voxels of its corners, so the wall to that part owes each corner
// of another one its share. What the triangles sweep on their way from there to where they were
// extracted is taken off, exactly. The sum over a wall that is closed is the voxels' volume less
// what the wall encloses.
#pragma once

#include "server/mesh/buffer.h"
#include "server/mesh/context.h"
#include "server/mesh/labels/label_index.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/stairs/wall_shape.h"

namespace isomesh::mesh {

// Returns, by fan of the shape and in its unit, the volume that the label at the wall's back lacks.
// Negative: it has too much. `shape` must be of that surface, which extract_walls made of the same
// parts and scheme and which has not been moved since. Caps stay flat, so what is missing at the
// rim of one is owed to the wall that leaves it, and within one it is left out; the bevels of the
// volume's box count as exact. The result is the same for any number of threads. Throws Error
// kCancelled.
Buffer<float> missing_volume(const SampleParts& parts, Scheme scheme,
                             const SeparatingSurface& surface, const WallShape& shape,
                             const Context& context);

}  // namespace isomesh::mesh
