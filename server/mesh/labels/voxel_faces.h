// The faces of voxels that labels share.
#pragma once

#include <cstdint>
#include <map>

#include "server/mesh/context.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/lattice/lattice.h"

namespace isomesh::mesh {

// The number of faces that the voxels of two parts share, by the parts of WallSides: `front` is the
// smaller number. Parts that share none are left out.
using VoxelFaces = std::map<WallSides, std::uint64_t>;

// Counts the faces between all samples, each of which stands for a voxel, in one walk. Voxels that
// have only an edge or a corner in common share no face, although a wall may be between them: the
// tetrahedra have edges along some diagonals of faces and cells. `options` as for count_walls. If
// the surface is closed, the faces in the lattice's border are between a label and the background.
// For the six integer types of SampleType. The same for any number of threads; each has memory for
// a few rows and for the pairs that meet in some planes. Thread safe. Throws Error kCancelled.
template <class T>
VoxelFaces count_faces(const Lattice<T>& lattice, const SeparateOptions& options,
                       const Context& context);

}  // namespace isomesh::mesh
