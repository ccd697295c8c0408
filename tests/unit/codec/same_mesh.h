// Whether a decoded mesh is the one that was encoded.
#pragma once

#include <vector>

#include "server/mesh/mesh.h"
#include "tests/support/draco_decoder.h"

namespace isomesh::test {

// Every vertex is held against its own place and every triangle against its own corners, within the
// grid of so many bits that encode.h promises.
void expect_same_mesh(const DecodedMesh& decoded, const mesh::Mesh& mesh, int position_bits);

// Several meshes as one, in which points of the same bits are one.
DecodedMesh welded(const std::vector<DecodedMesh>& parts);

}  // namespace isomesh::test
