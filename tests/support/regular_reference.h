// Regularised marching tetrahedra the slow and obvious way, to hold the kernels against: the rule
// of server/mesh/extract/links.h over links that are gathered from the tetrahedra themselves.
// Shares no code with the kernels.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/extract/extract.h"
#include "server/mesh/lattice/lattice.h"
#include "server/mesh/mesh.h"
#include "tests/support/stars.h"

namespace isomesh::test {

// An edge of a tetrahedron with a vertex of the plain surface.
struct Crossing {
  Sample inside;
  Sample outside;
};

struct JoiningField {
  const Stars& stars;
  std::span<const Crossing> crossings;
  std::function<float(const Sample&)> distance;  // from the iso-value
  std::function<bool(const Sample&)> is_within;  // whether all around it belong to the volume
};

// For each crossing its cluster, or kNotJoined.
std::vector<std::uint32_t> joined_crossings(const JoiningField& field);

// For each vertex of the kernels' plain mesh of five or six tetrahedra its cluster, or kNotJoined.
// Instantiated for the eight types of SampleType.
template <class T>
std::vector<std::uint32_t> regular_clusters(const mesh::Lattice<T>& lattice,
                                            const mesh::ExtractOptions& options);

// `regular` is what `plain`, the kernels' mesh without joining, becomes when the clusters are
// joined: its vertices at their means, the others where they were, and the same triangles in the
// same order without those that vanish. The one has the other's topology.
testing::AssertionResult is_joined(const mesh::Mesh& regular, const mesh::Mesh& plain,
                                   std::span<const std::uint32_t> clusters);

}  // namespace isomesh::test
