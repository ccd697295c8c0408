// Whether T+ and T- lie around all components of S; private to this folder.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/mesh/bound/proof.h"

namespace isomesh::mesh::bound {

using Edge = std::array<std::uint32_t, 2>;

// The edges of an odd number of triangles.
std::vector<Edge> odd_edges(std::size_t vertices, std::span<const Triangle> triangles);

// Of each crossing: the first crossing of its component of S.
std::vector<std::uint32_t> components_of(std::size_t crossings,
                                         std::span<const Triangle> triangles);

// The components, by their first crossing, of which a ray crosses T+ and T- an even number of
// times, or too near an edge to tell in several attempts. `components`: of each crossing.
// `border`: the edges of an odd number of triangles.
std::vector<std::uint32_t> uncovered(const Field& field, const Surfaces& surfaces,
                                     std::span<const std::uint32_t> components,
                                     std::span<const Edge> border, const Context& context);

}  // namespace isomesh::mesh::bound
