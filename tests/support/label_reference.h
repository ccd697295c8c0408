// The separating surface of labels the slow and obvious way, to hold the kernels against:
// tetrahedron by tetrahedron over the paper's Table 1, vertices found in a map by the samples that
// they lie between, winding found from where the labels lie. Shares no code with the kernels.
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
// numbers plus one layer of phantoms where the surface is closed.
struct LabelVertex {
  std::vector<Sample> samples;
  Point at;  // in units of the lattice, in the volume's own numbers
  bool on_border = false;
};

// A piece of one wall in one tetrahedron: three or four corners, counter-clockwise from `front`.
struct LabelPatch {
  std::vector<std::uint32_t> corners;
  mesh::WallSides sides;
  std::uint32_t layer = 0;      // k of its cell
  bool only_first_cut = false;  // between the first and the third corner, and not the other way
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

// The same surface: every vertex is the reference's, one to one, in its place and its layer; every
// patch is there between the same labels with the same winding and in its layer, and nothing else
// is; on_line and on_border are right.
testing::AssertionResult matches(const mesh::SeparatingSurface& surface,
                                 const LabelReference& reference);

}  // namespace isomesh::test
