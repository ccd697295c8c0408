// How much less the walls between labels enclose than the labels' voxels, and where.
//
// A tetrahedron of the lattice has a share of the voxels of its corners, and the walls in it leave
// each label another volume: half-way between one corner and three others they cut an eighth off,
// not a quarter. What is missing is owed to the wall's vertices in that tetrahedron. Where vertices
// were joined (label_clusters-inl.h), what the triangles swept meanwhile is taken off too, exactly.
// The sum over a wall that is closed is the voxels' volume less what the wall encloses.
#pragma once

#include "server/mesh/buffer.h"
#include "server/mesh/context.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/labels/wall_fans.h"
#include "server/mesh/lattice/lattice.h"

namespace isomesh::mesh {

// Returns, by fan and in voxels, the volume that the label at the wall's back lacks. Negative: it
// has too much. `surface` must come from extract_walls with the same lattice, options and count,
// and not have been moved since; `fans` are its own. For a closed surface, what is missing between
// the outermost samples and the caps is owed to vertices beside the caps, which stay flat; the
// bevels of the volume's box count as exact. For the six integer types of SampleType. The result is
// the same for any number of threads. Throws Error kCancelled.
template <class T>
Buffer<float> missing_volume(const Lattice<T>& lattice, const SeparateOptions& options,
                             const SurfaceCount& count, const WallFans& fans,
                             const Context& context, SeparatingSurface& surface);

}  // namespace isomesh::mesh
