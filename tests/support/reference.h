// Slow and simple marching tetrahedra, as a reference for the kernels: cell by cell and tetrahedron
// by tetrahedron over the paper's Table 1, vertices found in a map by their edge's samples, winding
// from the position of the inside. Shares no code with the kernels.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/extract/extract.h"
#include "server/mesh/lattice/lattice.h"
#include "server/mesh/mesh.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/shapes.h"

namespace isomesh::test {

// A vertex by its lattice edge. `fraction` is its exact position from the inside sample (0) to the
// outside one (1): 0 if the inside sample has the iso-value, and NaN if the outside one is a
// phantom beyond the border, which has no value.
struct ReferenceVertex {
  std::array<std::uint32_t, 3> inside;
  std::array<std::uint32_t, 3> outside;
  double fraction = 0;

  Point place() const;  // in lattice units
};

// The surface in one tetrahedron: three or four corners, counter-clockwise from outside. Either
// diagonal may split four corners into triangles.
struct ReferencePatch {
  std::vector<std::uint32_t> corners;
  std::uint32_t layer = 0;  // k of its cell
};

// For a closed surface the samples are those of the volume with one layer of phantoms around it:
// indices, dims and map are those of the larger lattice.
struct ReferenceMesh {
  bool closed = false;
  mesh::Dims dims;
  mesh::LatticeToSpace to_space;
  std::vector<ReferenceVertex> vertices;
  std::vector<ReferencePatch> patches;

  std::uint64_t triangles() const;
  bool is_phantom(const std::array<std::uint32_t, 3>& sample) const;
  // True if both samples of its edge are in one face of the volume's box, or one is a phantom.
  bool is_on_border(const ReferenceVertex& vertex) const;
  // Vertices have their exact fractions, so triangles may have zero area; patches are cut between
  // the first and the third corner.
  Surface surface() const;
};

// Instantiated for the eight types of SampleType. The samples must be finite.
template <class T>
ReferenceMesh reference_surface(const mesh::Lattice<T>& lattice,
                                const mesh::ExtractOptions& options);

// The largest distance that the kernels keep between a vertex and the ends of its edge, as a
// fraction of the edge. Vertices farther from both ends must be exact up to float rounding.
inline constexpr double kEndMargin = 1e-3;

// True if the surfaces are equal: the vertices of `mesh` correspond to the reference's lattice
// edges one to one; exactly the reference's patches exist, with their winding; vertices and
// triangles are in the layers that mesh.h promises. For a closed surface, vertices on edges to
// phantoms lie between the border samples adjacent to the edge, and on_border marks them and their
// rims.
testing::AssertionResult matches(const mesh::Mesh& mesh, const ReferenceMesh& reference);

}  // namespace isomesh::test
