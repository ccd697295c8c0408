// The sign of F on a triangle, by cutting it; private to this folder.
#pragma once

#include "server/mesh/bound/field.h"
#include "server/mesh/bound/vec.h"

namespace isomesh::mesh::bound {

// Whether the points are in the volume and sign * F is positive everywhere between them. Cuts the
// triangle at all planes of the tetrahedra and looks at F at the corners of the pieces.
bool has_one_sign(const Field& field, Vecd a, Vecd b, Vecd c, double sign);

}  // namespace isomesh::mesh::bound
