// What the encoder has found out about a surface as a surface; private to this folder.
#pragma once

#include <vector>

#include "server/codec/draco/corners.h"
#include "server/codec/draco/fans.h"
#include "server/codec/draco/traversal.h"
#include "server/mesh/topology/topology_parts.h"

namespace isomesh::codec::edgebreaker {

// Of a surface whose traversal is done and all of whose vertices are named by a triangle;
// `boundary` are the corners without an opposite. Vertices are numbered as before fans were
// separated.
mesh::PartTopology part_topology(const Connectivity& surface,
                                 const std::vector<std::vector<Corner>>& boundary, const Fans& fans,
                                 const Traversal& traversal);

}  // namespace isomesh::codec::edgebreaker
