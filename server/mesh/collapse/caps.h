// The caps of a closed surface, which nothing crosses; private to this folder.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "server/mesh/measure/point_triangle.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh::collapse {

// The planes in which a closed surface ends, at the faces of the volume and at its bevelled edges:
// those of triangles with all corners in the border, behind which the whole surface lies. None of
// an open surface. Immutable, so safe to read from several threads.
class Caps {
 public:
  // `triangles`: some of the mesh's or of what is left of it, by numbers of its vertices.
  Caps(const Mesh& mesh, std::span<const Triangle> triangles);

  // The share of the way from a place behind the planes that stays clear of them.
  double share_of_way(const Point& place, const Point& way) const;

 private:
  struct Plane {
    Point normal;
    double offset = 0;
  };
  // The error of a plane, by the way from a place of it.
  struct Slope {
    Point from;
    double rise = 0;
  };

  static bool is_behind(const Mesh& mesh, const Plane& plane, double depth, const Slope& slope,
                        std::size_t& in_front);

  std::vector<Plane> planes_;
};

}  // namespace isomesh::mesh::collapse
