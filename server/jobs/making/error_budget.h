// How the error that a job may have is shared out.
#pragma once

#include <vector>

#include "proto/types.h"
#include "server/mesh/mesh.h"

namespace isomesh::jobs {

// Of a job with `max_error_mm`: smoothing may take half, rounding coordinates a tenth, and
// simplification what those leave.

// How far smoothing may move a vertex; infinite where nothing bounds it.
double most_displacement(const MeshParameters& parameters);

// The parameters with as many bits for Draco's coordinates as the error takes, and at least those
// that were asked for. Throws Error kInvalidParameter, field "max_error_mm", when Draco has too
// few.
MeshParameters with_bits_for(const MeshParameters& parameters, const mesh::Mesh& mesh);

// The most that rounding to the files' coordinates moves a point of the mesh, in millimetres: half
// the diagonal of a cell of Draco's grid, and what single precision cannot tell. Also after
// vertices were moved by `moved_mm`, which makes the grid larger.
double quantisation_mm(const MeshParameters& parameters, const mesh::Mesh& mesh,
                       double moved_mm = 0);

// The formats whose surface a certificate measures, in the files' order: each that rounds
// coordinates, and the first of the others, which all hold the mesh itself.
std::vector<MeshFormat> measured_formats(const MeshParameters& parameters);

}  // namespace isomesh::jobs
