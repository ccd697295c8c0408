// Checks of surfaces, implemented simply and independently of the kernels: topology, extent,
// soundness, and a naive smoother. Pure functions; safe from several threads.
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

// A copy of a mesh of the kernels, the reference or a decoder, in double.
struct Surface {
  std::vector<Point> points;
  std::vector<mesh::Triangle> triangles;
};

Surface surface_of(const mesh::Mesh& mesh);

// A directed edge, in the direction of its triangle.
using DirectedEdge = std::array<std::uint32_t, 2>;

struct TopologyFacts {
  std::uint64_t edges = 0;
  std::vector<DirectedEdge> boundary_edges;  // of only one triangle
  std::uint64_t crowded_edges = 0;           // of more than two triangles
  std::uint64_t misoriented_edges = 0;       // two triangles run through it in the same direction
  std::uint64_t pinched_vertices = 0;        // triangles are not one fan, open or closed
  std::uint64_t unused_vertices = 0;
  std::uint64_t repeating_triangles = 0;  // with a repeated vertex
  std::uint64_t components = 0;           // of the used vertices
  std::uint64_t boundary_loops = 0;
  std::int64_t euler = 0;  // vertices - edges + triangles

  // Handles of all components together. For an oriented manifold.
  std::int64_t genus() const;
};

// Vertex indices must be valid.
TopologyFacts topology_of(const Surface& surface);

struct ExtentFacts {
  double area = 0;
  double volume = 0;     // signed sum of the tetrahedra from every triangle to the apex
  double perimeter = 0;  // of all triangles: bounds the change of area when points move
  double smallest_area = 0;
  std::uint64_t flat_triangles = 0;
  Point low = {0, 0, 0};
  Point high = {0, 0, 0};
};

ExtentFacts extent_of(const Surface& surface, const Point& apex = {0, 0, 0});

// Checks the properties of every extracted mesh: indices in range, finite points, an oriented
// manifold with at most two triangles on an edge and one fan around a vertex, no unused vertex, no
// triangle with a repeated vertex or of zero area. The failure counts each violation.
testing::AssertionResult is_sound(const Surface& surface);

// Checks that both ends of every boundary edge lie on a common face of the lattice's bounding box,
// within `tolerance` in lattice units.
testing::AssertionResult boundary_is_on_border(const Surface& surface, const mesh::Dims& dims,
                                               const mesh::LatticeToSpace& map,
                                               double tolerance = 1e-3);

// Checks that the layers are as mesh.h has them.
void expect_layers(const mesh::Mesh& mesh);

// Compares every array byte by byte. The failure names the first that differs.
testing::AssertionResult same_bytes(const mesh::Mesh& a, const mesh::Mesh& b);

// Each vertex's neighbours, ascending; none for boundary vertices.
std::vector<std::vector<std::uint32_t>> free_neighbors(const Surface& surface);

// Smoothing over sets of neighbours, with one step per relaxation factor: all points move from the
// previous step's, boundary points stay. Positions are rounded to float after each step, as in the
// kernels.
Surface naively_smoothed(const Surface& surface, const std::vector<double>& shares);

// Marks the corners of triangles with an area below 1e-4, which rounding may make zero.
std::vector<bool> corners_of_flat(const std::vector<Point>& points,
                                  const std::vector<mesh::Triangle>& triangles);

}  // namespace isomesh::test
