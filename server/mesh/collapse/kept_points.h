// Distances between a surface and what is left of it, at some points of both; private to this
// folder.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/mesh/context.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/measure/point_triangle.h"
#include "server/mesh/measure/surface_view.h"
#include "server/mesh/measure/triangle_grid.h"

namespace isomesh::mesh::collapse {

// The vertices and centres of the original triangles. Each is near a triangle that is left, whose
// centre is near the original. Triangles keep their numbers. Takes some 10 bytes a triangle beside
// the grid. Thread safe for different triangles.
class KeptPoints {
 public:
  // `sides`: of each triangle; empty if there is one wall. Throws as TriangleGrid.
  KeptPoints(const SurfaceView& original, std::span<const WallSides> sides, double max_error_mm,
             const Context& context);

  struct Shape {
    std::uint32_t triangle = 0;
    mesh::Corners corners;
  };

  // Whether these shapes may come instead of the triangles of the `star`, some of which they are.
  // If so, the points of these are theirs, each one's of its own wall.
  bool replace(std::span<const std::uint32_t> star, std::span<const Shape> shapes);

 private:
  std::uint32_t home_of(std::uint32_t point, std::uint32_t triangle,
                        std::span<const Shape> shapes) const;

  const SurfaceView original_;
  const std::span<const WallSides> sides_;
  const double squared_mm_;
  const TriangleGrid grid_;
  std::vector<std::uint32_t> first_;  // of each triangle
  std::vector<std::uint32_t> next_;   // of each point, of the same triangle
};

}  // namespace isomesh::mesh::collapse
