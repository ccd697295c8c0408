// Collapses that keep T+ inside S and T- outside, in one block of triangles; private to this
// folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "server/mesh/collapse/field.h"
#include "server/mesh/collapse/patches.h"
#include "server/mesh/collapse/tube.h"

namespace isomesh::mesh::collapse {

// The data that collapses need besides the tube. Metric and reach are in one unit near the steps of
// the lattice: quadrics multiply three areas in single precision.
struct CollapseSurroundings {
  const Field& field;
  const Metric metric;
  double reach = 0;  // how far T+ and T- are put from T
};

// Some triangles of a tube.
struct Block {
  Patch& patch;
  std::vector<Vertex> vertices;
  std::vector<std::uint8_t> planes;  // of each vertex: the faces of the volume that it stays in
};

// Collapses what may go until `least` triangles are left, and leaves only the triangles that
// remain. Vertices on the block's boundary keep their places and are set in `stays`.
void collapse_block(const CollapseSurroundings& around, std::size_t least, Block& block);

}  // namespace isomesh::mesh::collapse
