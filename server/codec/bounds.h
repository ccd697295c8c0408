// The smallest box along the axes that holds some points. Private to this folder.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

#include "server/mesh/mesh.h"

namespace isomesh::codec {

struct Bounds {
  mesh::Vec3 low = {0, 0, 0};
  mesh::Vec3 high = {0, 0, 0};
};

// `Point` has three coordinates that single precision holds. The point 0 if there are no points.
template <class Point>
Bounds bounds_of(std::span<const Point> points) {
  if (points.empty()) return {};
  Point low = points[0];
  Point high = low;
  for (const Point& point : points) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], point[axis]);
      high[axis] = std::max(high[axis], point[axis]);
    }
  }
  Bounds bounds;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    bounds.low[axis] = static_cast<float>(low[axis]);
    bounds.high[axis] = static_cast<float>(high[axis]);
  }
  return bounds;
}

}  // namespace isomesh::codec
