// A slow and simple separating surface of labels, as a reference for the kernels: tetrahedron by
// tetrahedron over the paper's Table 1, vertices found in a map by their adjacent samples, winding
// from the labels' positions. Shares no code with the kernels.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/labels/separate.h"
#include "server/mesh/lattice/lattice.h"
#include "tests/support/shapes.h"
#include "tests/support/tetrahedra.h"

namespace isomesh::test {

// A vertex of an edge, a face or a tetrahedron, by its two to four samples, in the volume's own
// indices plus one layer of phantoms if the surface is closed.
struct LabelVertex {
  std::vector<Sample> samples;
  Point at;  // in lattice units, in the volume's own indices
  bool on_border = false;
};

// One wall's polygon in one tetrahedron: three or four corners, counter-clockwise from `front`.
struct LabelPatch {
  std::vector<std::uint32_t> corners;
  mesh::WallSides sides;
  std::uint32_t layer = 0;      // k of its cell
  bool only_first_cut = false;  // between the first and the third corner, not the other diagonal
};

struct LabelReference {
  mesh::LatticeToSpace to_space;
  std::vector<LabelVertex> vertices;
  std::vector<LabelPatch> patches;

  std::uint64_t triangles() const;
};

// For the six integer types of SampleType.
template <class T>
LabelReference label_reference(const mesh::Lattice<T>& lattice,
                               const mesh::SeparateOptions& options);

// True if the surfaces are equal: vertices correspond one to one, in position and layer; exactly
// the reference's patches exist, with their labels, winding and layer; on_line and on_border are
// right.
testing::AssertionResult matches(const mesh::SeparatingSurface& surface,
                                 const LabelReference& reference);

// The reference's vertex in the place of each vertex of a mesh that matches it; fewer if one is not
// there.
std::vector<std::uint32_t> names_of_vertices(const mesh::Mesh& mesh,
                                             const LabelReference& reference);

}  // namespace isomesh::test
