// Checks of a surface some of whose vertices were joined, beside the one that it comes from.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/mesh.h"

namespace isomesh::test {

inline constexpr std::uint32_t kNotJoined = ~std::uint32_t{0};

// The vertex of the regular mesh that each vertex of the plain one becomes, or kNotJoined if it is
// in no triangle there. `clusters`: for each vertex of the plain mesh its cluster, or kNotJoined.
// It is read off the triangles, which are in the same order; empty if those are not the plain ones
// without those that vanish.
std::vector<std::uint32_t> joined_to(const mesh::Mesh& regular, const mesh::Mesh& plain,
                                     std::span<const std::uint32_t> clusters);

// Both are oriented manifolds, and the one has the other's connected components, each with its
// Euler number and boundary curves. No two triangles of `regular` have the same corners. `to` says
// what each vertex of the one became in the other.
testing::AssertionResult has_topology(std::span<const mesh::Triangle> regular,
                                      std::span<const mesh::Triangle> plain,
                                      std::span<const std::uint32_t> to);

}  // namespace isomesh::test
