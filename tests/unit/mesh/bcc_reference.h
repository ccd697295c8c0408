// The surface on the body-centred lattice by enumeration of its tetrahedra, without tables and
// without code of the kernels.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/extract/extract.h"
#include "tests/support/shapes.h"

namespace isomesh::test {

// A sample or a centre in half cells: all coordinates are even, or all are odd.
using HalfCells = std::array<int, 3>;

// A vertex by the edge that it is on. Sorted as the kernels number them.
struct BccVertex {
  std::array<int, 3> record;  // z, y, x of the sample that owns it; phantoms have numbers, too
  int slot = 0;               // bcc_faces.h
  HalfCells inside;
  HalfCells outside;
  double fraction = 0;        // of the way from inside to outside; NaN where that is a phantom
  bool is_on_border = false;  // of a closed surface
};

struct BccReference {
  std::vector<BccVertex> vertices;
  std::vector<std::vector<std::uint32_t>> patches;  // three or four corners, as ReferencePatch
  std::uint64_t triangles() const;
};

// Instantiated for the eight types of SampleType.
template <class T>
BccReference bcc_reference(const mesh::Lattice<T>& lattice, const mesh::ExtractOptions& options);

// For each vertex of the reference the cluster that regularising joins it to, or kNotJoined.
template <class T>
std::vector<std::uint32_t> bcc_clusters(const mesh::Lattice<T>& lattice,
                                        const mesh::ExtractOptions& options,
                                        const BccReference& reference);

// True if `mesh` has the reference's vertices in their order and places, its patches with their
// winding, and the layers that mesh.h promises.
template <class T>
testing::AssertionResult matches(const mesh::Mesh& mesh, const BccReference& reference,
                                 const mesh::Lattice<T>& lattice);

}  // namespace isomesh::test
