// The surface at an iso-value the slow and obvious way, on all lattices, plain and regularised:
// what the kernels of server/mesh/extract do, without words of 64 samples, slabs, tables of cases
// and threads, and without code of theirs. The kernels are compared with it. A reader of them
// begins here:
//  1. Points are samples and, on the body-centred lattice, centres of cells. Tetrahedra connect
//     them. Around a volume that is closed there is one layer of phantoms, which are outside.
//  2. An edge of a tetrahedron is crossed if one end is inside. Its crossing is a vertex, whose
//     name is the sample that owns the edge and the edge's slot there. Vertices are in the order of
//     their names.
//  3. Each tetrahedron with crossings has one triangle, or two.
//  4. Regularised, each point joins the crossings that are nearer to it than to their other end,
//     where the rule of server/mesh/extract/links.h allows it.
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

// In half cells: all coordinates of a sample are even, all of a centre odd.
using HalfCells = std::array<int, 3>;

// A crossed edge. `share` is the way from `inside` to the surface, as a part of the edge: 0 if the
// inside point has the iso-value, and NaN if the outside one is a phantom, which has no value.
struct ScalarCrossing {
  HalfCells inside;
  HalfCells outside;
  double share = 0;
  bool is_on_border = false;  // of a closed surface
};

struct ScalarVertex {
  std::size_t layer = 0;
  std::vector<ScalarCrossing> crossings;  // of a cluster several; it is at their mean
};

// Vertices are in the kernels' order, triangles in that of their layers.
struct ScalarSurface {
  mesh::LatticeToSpace to_space;
  mesh::Dims dims;
  std::vector<ScalarVertex> vertices;
  std::vector<mesh::Triangle> triangles;
  std::vector<std::uint64_t> layer_vertices;
  std::vector<std::uint64_t> layer_triangles;
  // For each vertex of the plain surface the one that it becomes. The same one if that is this.
  std::vector<std::uint32_t> becomes;

  // Vertices have their exact shares, so triangles may have zero area. Only of a surface that is
  // open.
  Surface surface() const;
};

// The samples must be finite; those of other types are doubles, too (in_doubles).
ScalarSurface scalar_surface(const mesh::Lattice<double>& lattice,
                             const mesh::ExtractOptions& options);

// The same samples.
template <class T>
SampleVolume<double> in_doubles(const SampleVolume<T>& volume) {
  return {{volume.samples.begin(), volume.samples.end()}, volume.dims, volume.geometry};
}

// The largest distance that the kernels keep between a vertex and the ends of its edge, as a part
// of the edge. Vertices farther from both ends must be exact up to float rounding.
inline constexpr double kEndMargin = 2e-3;

// True if the surfaces are equal: `mesh` has the reference's layers, its vertices in their order
// and places, the same triangles in each layer with their winding, and the same marks of the
// border.
testing::AssertionResult matches(const mesh::Mesh& mesh, const ScalarSurface& reference);

}  // namespace isomesh::test
