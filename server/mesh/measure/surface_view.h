// A surface as arrays.
#pragma once

#include <span>

#include "server/mesh/mesh.h"

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

}  // namespace isomesh::mesh
