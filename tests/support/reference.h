// Marching tetrahedra the slow and obvious way, to hold the kernels against: cell by cell and
// tetrahedron by tetrahedron over the paper's Table 1, vertices found in a map by the two samples
// of their edge, winding found from where the inside lies. Shares no code with the kernels.
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

// A vertex by its lattice edge. `fraction` is the exact share of the way from the inside sample to
// the outside one: 0 where the inside sample has the iso-value, and NaN where the outside one is a
// phantom beyond the border, which has no value.
struct ReferenceVertex {
  std::array<std::uint32_t, 3> inside;
  std::array<std::uint32_t, 3> outside;
  double fraction = 0;

  Point place() const;  // in units of the lattice
};

// The piece of the surface in one tetrahedron: three or four corners, counter-clockwise from
// outside. Either diagonal may cut one of four corners into triangles.
struct ReferencePatch {
  std::vector<std::uint32_t> corners;
  std::uint32_t layer = 0;  // k of its cell
};

// Of a surface that is closed the samples are those of the volume with one layer of phantoms around
// it: numbers, dims and map are of that larger lattice.
struct ReferenceMesh {
  bool closed = false;
  mesh::Dims dims;
  mesh::LatticeToSpace to_space;
  std::vector<ReferenceVertex> vertices;
  std::vector<ReferencePatch> patches;

  std::uint64_t triangles() const;
  bool is_phantom(const std::array<std::uint32_t, 3>& sample) const;
  // Whether both samples of its edge are in one face of the volume's box, or one is a phantom.
  bool is_on_border(const ReferenceVertex& vertex) const;
  // With vertices at their exact fractions, so triangles may have no area; patches are cut between
  // the first and the third corner.
  Surface surface() const;
};

// Instantiated for the eight types of SampleType. The samples must be finite.
template <class T>
ReferenceMesh reference_surface(const mesh::Lattice<T>& lattice,
                                const mesh::ExtractOptions& options);

// How far the kernels may keep a vertex away from the samples at the ends of its edge, as a share
// of the edge. A vertex that is farther from both must be exact up to the rounding of floats.
inline constexpr double kEndMargin = 1e-3;

// The same surface: every vertex of `mesh` is the reference's vertex of one lattice edge, one to
// one; every patch is there with the same winding and nothing else is; vertices and triangles are
// in the layers that mesh.h promises. Of a closed surface, vertices on edges to phantoms lie
// between the samples of the border that the edge is next to, and on_border tells them and their
// rims.
testing::AssertionResult matches(const mesh::Mesh& mesh, const ReferenceMesh& reference);

}  // namespace isomesh::test
