// The layers of a mesh that has lost vertices; private to the kernels.
#pragma once

#include <vector>

#include "server/mesh/labels/separate.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh {

// Gives the mesh these triangles instead of its own, and forgets the vertices that none of them
// names, and Mesh::kept. Vertices keep their order, triangles are ordered by their first vertex;
// layers are joined, as few as let each triangle name vertices of two consecutive ones. `sides`, of
// each triangle, are ordered with them; empty where they have none.
void replace_triangles(std::vector<Triangle>& triangles, std::vector<WallSides>& sides, Mesh& mesh);

}  // namespace isomesh::mesh
