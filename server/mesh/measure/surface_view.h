// A surface as arrays.
#pragma once

#include <span>

#include "server/mesh/points.h"

namespace isomesh::mesh {

// Triangles as indices of positions in millimetres, in any order; open or closed, manifold or not.
// Owns nothing.
struct SurfaceView {
  SurfaceView() = default;
  SurfaceView(std::span<const Vec3> its_positions, std::span<const Triangle> its_triangles)
      : positions(its_positions), triangles(its_triangles) {}
  SurfaceView(const Mesh& mesh)  // NOLINT: an implicit conversion
      : positions(mesh.positions.span()), triangles(mesh.triangles.span()) {}

  std::span<const Vec3> positions;
  std::span<const Triangle> triangles;
};

// The points by which distances are measured, by number: the vertices, then the triangles' centres.
inline Point measured_point(const SurfaceView& surface, std::size_t number) {
  const std::size_t vertices = surface.positions.size();
  if (number < vertices) return to_point(surface.positions[number]);
  Point centre = {0, 0, 0};
  for (const std::uint32_t vertex : surface.triangles[number - vertices]) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      centre[axis] += surface.positions[vertex][axis] / 3.0;
    }
  }
  return centre;
}

}  // namespace isomesh::mesh
