// Regularised marching tetrahedra the slow and obvious way, to hold the kernels against: the rule
// of server/mesh/extract/links.h over links that are gathered from the tetrahedra themselves.
// Shares no code with the kernels.
#pragma once

#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/extract/extract.h"
#include "server/mesh/lattice/lattice.h"
#include "server/mesh/mesh.h"
#include "tests/support/reference.h"

namespace isomesh::test {

// The vertices of the plain surface that become one, all on edges of one sample.
struct ReferenceCluster {
  std::array<std::uint32_t, 3> sample;
  std::vector<std::uint32_t> vertices;  // of the reference's, ascending
};

struct RegularReference {
  ReferenceMesh plain;
  std::vector<ReferenceCluster> clusters;
};

// Instantiated for the eight types of SampleType.
template <class T>
RegularReference regular_reference(const mesh::Lattice<T>& lattice,
                                   const mesh::ExtractOptions& options);

// `regular` is what `plain`, the kernels' mesh without joining, becomes when the reference's
// clusters are joined: its vertices at their means, the others where they were, and the same
// triangles in the same order without those that vanish.
testing::AssertionResult matches(const mesh::Mesh& regular, const mesh::Mesh& plain,
                                 const RegularReference& reference);

// Both are oriented manifolds, and the one has the other's connected components, each with its
// Euler number and boundary curves. No two triangles of `regular` have the same corners.
testing::AssertionResult has_topology_of(const mesh::Mesh& regular, const mesh::Mesh& plain,
                                         const RegularReference& reference);

}  // namespace isomesh::test
