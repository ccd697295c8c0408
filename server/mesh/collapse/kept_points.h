// Distances between a surface and what is left of it, at some points of both; private to this
// folder.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/mesh/collapse/misses.h"
#include "server/mesh/measure/point_triangle.h"

namespace isomesh::mesh::collapse {

// The vertices and centres of the original triangles. Each is near a triangle that is left, whose
// centre and middles of edges are near the original; both of the same wall. Triangles keep their
// numbers. Takes some 14 bytes a triangle. Thread safe for different triangles.
class KeptPoints {
 public:
  // `grids`: of the original; must outlive it.
  KeptPoints(const WalledSurface& original, const WallGrids& grids, double max_error_mm);

  // A triangle with a new first corner. The edge to its second one may be new, and with
  // `is_third_new` that to its third; the others were near before.
  struct Shape {
    std::uint32_t triangle = 0;
    mesh::Corners corners;
    bool is_third_new = false;
  };

  // True if these shapes, some of the triangles of the `star`, may take its place. If so, the
  // points of these are theirs, each one's of its own wall.
  bool replace(std::span<const std::uint32_t> star, std::span<const Shape> shapes);

 private:
  bool is_near(const Shape& shape) const;
  std::uint32_t home_of(std::uint32_t point, std::uint32_t triangle,
                        std::span<const Shape> shapes) const;

  const WalledSurface original_;
  const WallGrids& grids_;
  const double squared_mm_;           // that a point may have
  std::vector<std::uint32_t> first_;  // of each triangle
  std::vector<std::uint32_t> next_;   // of each point, of the same triangle
};

}  // namespace isomesh::mesh::collapse
