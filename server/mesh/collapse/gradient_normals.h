// Normals of a surface at an iso-value from the samples that it was made of.
//
// The facets of a simplified surface are seen if its vertices are shaded by its triangles. The
// gradient of the samples is where the surface was before, so with it a surface of a tenth of the
// triangles looks as round as all of them.
#pragma once

#include "server/mesh/context.h"
#include "server/mesh/lattice/lattice.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh {

// Sets mesh.normals: the way out in which the samples change fastest, from central differences,
// linear between the samples. They fall that way, or rise if `inside` is kBelow. Those of the
// triangles (normals.h) on caps, and where the gradient has no direction or one that turns away
// from them. The same for any number of threads. Throws Error kCancelled.
template <class T>
void set_gradient_normals(const Lattice<T>& lattice, Inside inside, const Context& context,
                          Mesh& mesh);

}  // namespace isomesh::mesh
