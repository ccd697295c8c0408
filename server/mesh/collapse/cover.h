// Tests whether T+ and T- lie around all components of S; private to this folder.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/mesh/collapse/edges.h"
#include "server/mesh/collapse/proof.h"

namespace isomesh::mesh::collapse {

// The components of S, by number, of which a ray crosses T+ and T- an even number of times, or too
// near an edge to tell in several attempts. `border`: the edges of T of an odd number of triangles.
// Triangles of T+ and T- lie in the volume.
std::vector<std::uint32_t> uncovered(const Field& field, const Surfaces& surfaces,
                                     std::span<const Edge> border, const Context& context);

}  // namespace isomesh::mesh::collapse
