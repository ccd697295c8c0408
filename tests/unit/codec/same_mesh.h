// Checks that a decoded mesh is the one that was encoded.
#pragma once

#include <array>
#include <vector>

#include "server/mesh/mesh.h"
#include "tests/support/draco_decoder.h"

namespace isomesh::test {

// The grid that the header promises: it starts at the mesh's lowest corner and its cube's side is
// the mesh's longest extent.
struct Grid {
  std::array<double, 3> low = {};
  double step = 0;
  double float_error = 0;  // what single precision costs, which counts from 20 bits on
};

Grid grid_of(const mesh::Mesh& mesh, int position_bits);

// Every vertex is held against its own place and every triangle against its own corners, within the
// grid of so many bits that encode.h promises.
void expect_same_mesh(const DecodedMesh& decoded, const mesh::Mesh& mesh, int position_bits);

// Several meshes as one, in which points of the same bits are one.
DecodedMesh welded(const std::vector<DecodedMesh>& parts);

}  // namespace isomesh::test
