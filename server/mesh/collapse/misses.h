// Finds where a surface is farther than a distance from another, at any of its points; private to
// the kernels.
//
// A triangle is within the distance of another one if its corners are, since a distance from a
// convex set is convex. And where a place is so much nearer than asked, all places around it are
// near enough, since a distance changes no faster than the place. A triangle of which neither tells
// enough is cut in four.
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

// The triangles of a surface by the wall that they belong to, with an index of each wall. The
// view's arrays and the sides must outlive it. Immutable, so safe to read from several threads.
class WallGrids {
 public:
  static constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();

  // `sides`: of each triangle; if it is empty, all are of one wall. Throws as TriangleGrid.
  WallGrids(const SurfaceView& surface, std::span<const WallSides> sides, const Context& context);
  WallGrids(const WallGrids&) = delete;

  const SurfaceView& surface() const { return surface_; }
  std::size_t walls() const { return sides_.size(); }
  std::size_t wall_of(std::uint32_t triangle) const { return wall_of_[triangle]; }
  WallSides sides(std::size_t wall) const { return sides_[wall]; }
  // kNone if the surface has no such wall.
  std::size_t find(const WallSides& sides) const;

  const TriangleGrid& grid(std::size_t wall) const { return grids_[wall]; }
  // The surface's number of a triangle of grid(wall).
  std::uint32_t triangle_of(std::size_t wall, std::uint32_t in_grid) const {
    return members_[begins_[wall] + in_grid];
  }

 private:
  const SurfaceView surface_;
  std::vector<WallSides> sides_;        // of each wall, in ascending order
  std::vector<std::uint32_t> wall_of_;  // by triangle
  std::vector<std::size_t> begins_;     // of each wall's in `members_`, and the end
  std::vector<std::uint32_t> members_;  // numbers of triangles
  std::vector<Triangle> triangles_;     // the same ones
  std::deque<TriangleGrid> grids_;      // of each wall
};

struct Miss {
  std::uint32_t triangle = 0;
  Point place = {0, 0, 0};  // in it: the farthest that was found
};

// The triangles of `from` with a place that is farther than `within_mm`, which is more than 0, from
// the same wall of `to`; and those for which pieces of a thousandth of the distance do not tell. So
// if there are none, all places are near enough. In ascending order, for any number of threads.
// Throws Error kCancelled.
std::vector<Miss> find_misses(const WallGrids& from, const WallGrids& to, double within_mm,
                              const Context& context);

}  // namespace isomesh::mesh
