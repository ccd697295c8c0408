// Cubes near some boxes; private to the kernels.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "server/mesh/measure/surface_view.h"
#include "server/mesh/points.h"

namespace isomesh::mesh {

struct Box {
  Point low = {0, 0, 0};
  Point high = {0, 0, 0};
};

Box box_of(const SurfaceView& surface, const Triangle& triangle);

// Cubes that are marked within reach of boxes, at most 512 along each axis. Takes up to 16 MiB.
// Immutable, so safe to read from several threads.
class MarkedCubes {
 public:
  // Boxes must be finite.
  MarkedCubes(std::span<const Box> boxes, double reach_mm);

  // True if the box is within reach of one of those, and for some others near them.
  bool are_near(const Box& box) const;

 private:
  using Cube = std::array<std::size_t, 3>;
  struct CubeRange {
    Cube low;
    Cube high;  // the last one
  };

  CubeRange around(const Box& box) const;
  template <class IsEnough>
  bool visit(const CubeRange& range, IsEnough is_enough) const;

  double reach_mm_;
  Point low_ = {0, 0, 0};
  double per_mm_ = 1;  // cubes
  Cube count_ = {1, 1, 1};
  std::vector<bool> is_marked_;
};

}  // namespace isomesh::mesh
