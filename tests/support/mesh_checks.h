// What tests say about a surface, computed the plain way and apart from the kernels: topology,
// extent, soundness, and a naive smoother. Pure functions; safe from several threads.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/lattice/lattice.h"
#include "server/mesh/mesh.h"
#include "tests/support/shapes.h"

namespace isomesh::test {

// A mesh from wherever it came: the kernels, the reference or a decoder. Its own copy, in double.
struct Surface {
  std::vector<Point> points;
  std::vector<mesh::Triangle> triangles;
};

Surface surface_of(const mesh::Mesh& mesh);

// A directed edge, as the triangle that it belongs to runs through it.
using DirectedEdge = std::array<std::uint32_t, 2>;

struct TopologyFacts {
  std::uint64_t edges = 0;
  std::vector<DirectedEdge> boundary_edges;  // of one triangle only
  std::uint64_t crowded_edges = 0;           // of more than two triangles
  std::uint64_t misoriented_edges = 0;  // run through twice in the same direction by two triangles
  std::uint64_t pinched_vertices = 0;   // whose triangles are not one fan, open or closed
  std::uint64_t unused_vertices = 0;
  std::uint64_t repeating_triangles = 0;  // that name a vertex more than once
  std::uint64_t components = 0;           // of the used vertices
  std::uint64_t boundary_loops = 0;
  std::int64_t euler = 0;  // vertices - edges + triangles

  // Handles, all components together. For an oriented manifold.
  std::int64_t genus() const;
};

// All indices must name points.
TopologyFacts topology_of(const Surface& surface);

struct ExtentFacts {
  double area = 0;
  double volume = 0;         // signed sum of the tetrahedra from every triangle to the apex
  double perimeter = 0;      // of all triangles, summed: how much area can change when points move
  double smallest_area = 0;  // of any triangle
  std::uint64_t flat_triangles = 0;  // of zero area
  Point low = {0, 0, 0};
  Point high = {0, 0, 0};
};

ExtentFacts extent_of(const Surface& surface, const Point& apex = {0, 0, 0});

// What every extracted mesh must be: indices in range, finite points, an oriented manifold with at
// most two triangles on an edge and one fan around a vertex, no unused vertex, no triangle with a
// repeated vertex or of zero area. The failure says how many of what are wrong.
testing::AssertionResult is_sound(const Surface& surface);

// Both ends of every boundary edge lie on one common face of the lattice's bounding box, within
// `tolerance` in units of the lattice.
testing::AssertionResult boundary_is_on_border(const Surface& surface, const mesh::Dims& dims,
                                               const mesh::LatticeToSpace& map,
                                               double tolerance = 1e-3);

// The same bytes in every array. The failure names the first that differs.
testing::AssertionResult same_bytes(const mesh::Mesh& a, const mesh::Mesh& b);

// The neighbours of every vertex in ascending order; none for one that lies on the boundary.
std::vector<std::vector<std::uint32_t>> free_neighbors(const Surface& surface);

// Smoothing over sets of neighbours, one step for each share of the way to their mean: all points
// move from the last step's, boundary points stay. Positions are rounded to float after each step,
// as the kernels keep them.
Surface naively_smoothed(const Surface& surface, const std::vector<double>& shares);

}  // namespace isomesh::test
