// Finds where a surface is farther than a distance from another, at any of its points; private to
// the kernels.
//
// A part of a triangle is within the distance of another triangle if its corners are, since a
// distance from a convex set is convex. And where a place is so much nearer than asked, all places
// around it are near enough, since a distance changes no faster than the place. A part of which
// neither tells enough is cut in two: where it reaches beyond the nearest triangle, or in its
// middle.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <span>
#include <vector>

#include "server/mesh/context.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/measure/triangle_grid.h"

namespace isomesh::mesh {

struct WalledSurface {
  SurfaceView view;
  std::span<const WallSides> sides;  // of each triangle; empty if all are of one wall

  WallSides sides_of(std::size_t triangle) const {
    return sides.empty() ? WallSides{} : sides[triangle];
  }
};

// An index of each wall's triangles. Positions must outlive it. Immutable, so safe to read from
// several threads.
class WallGrids {
 public:
  static constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();

  // Throws as TriangleGrid.
  WallGrids(const WalledSurface& surface, const Context& context);
  WallGrids(const WallGrids&) = delete;

  std::size_t walls() const { return sides_.size(); }
  // The number of a wall; kNone if the surface has no such wall.
  std::size_t find(const WallSides& sides) const;
  const TriangleGrid& grid(std::size_t wall) const { return grids_[wall]; }

  // The index of a triangle's own wall, and its number there.
  const TriangleGrid& grid_of(std::uint32_t triangle) const { return grids_[wall_[triangle]]; }
  std::uint32_t number_in_grid(std::uint32_t triangle) const { return number_[triangle]; }

 private:
  std::vector<WallSides> sides_;              // of each wall, in ascending order
  std::vector<std::uint32_t> wall_, number_;  // by triangle
  std::vector<Triangle> triangles_;           // of one wall after the other
  std::deque<TriangleGrid> grids_;
};

struct Miss {
  std::uint32_t triangle = 0;
  Point place = {0, 0, 0};  // in it: the farthest that was found
};

// The misses among the triangles `which` of `from`, in their order: those with a place that is
// farther than `within_mm`, which is more than 0, from the same wall of `to`, and those for which
// pieces of a thousandth of the distance do not tell. So if there are none, all places are near
// enough. The same for any number of threads. Throws Error kCancelled.
std::vector<Miss> find_misses(const WalledSurface& from, std::span<const std::uint32_t> which,
                              const WallGrids& to, double within_mm, const Context& context);

}  // namespace isomesh::mesh
