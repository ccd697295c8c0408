// The topology that the encoder found. Private to this folder.
#pragma once

#include <vector>

#include "server/codec/draco/corners.h"
#include "server/codec/draco/fans.h"
#include "server/codec/draco/traversal.h"
#include "server/mesh/topology/topology_parts.h"

namespace isomesh::codec::edgebreaker {

// For a surface after its traversal, with every vertex in a triangle. `boundary` holds the corners
// without an opposite. Vertices are numbered as before Fans::separate.
mesh::PartTopology part_topology(const Connectivity& surface,
                                 const std::vector<std::vector<Corner>>& boundary, const Fans& fans,
                                 const Traversal& traversal);

}  // namespace isomesh::codec::edgebreaker
