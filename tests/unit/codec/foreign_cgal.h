// Mesh files of text as CGAL reads them.
#pragma once

#include <string>

#include "proto/types.h"
#include "tests/support/draco_decoder.h"

namespace isomesh::test {

// The vertices and triangles of a file of the format obj or off, which is not empty, in its order.
// CGAL reads numbers exactly, which assimp does not. Throws std::runtime_error when it refuses.
DecodedMesh read_with_cgal(const std::string& bytes, MeshFormat format);

}  // namespace isomesh::test
