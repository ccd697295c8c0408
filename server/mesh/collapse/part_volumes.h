// The volumes of parts between walls, before and after simplification; private to this folder.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/mesh/collapse/history.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/measure/point_triangle.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh::collapse {

// The volume of each part (label_parts.h) with walls around it, but the background. A part that is
// open at the border of the volume has that of the cones from the middle of its walls, whose
// changes are right because the ends stay; shares of it are of a tenth of the ball with the same
// area at least. All have 0 where there are no walls. Immutable, so safe to read from several
// threads.
class PartVolumes {
 public:
  // `sides`: of the mesh's triangles, empty if all are of one wall.
  PartVolumes(const Mesh& mesh, std::span<const WallSides> sides);

  // By how much each part is larger with these triangles, whose vertices are at these places.
  // `numbers`: of each, that of a triangle of the mesh with the same walls. Cubic millimetres.
  std::vector<double> changes(std::span<const Vec3> places, std::span<const Triangle> triangles,
                              std::span<const std::uint32_t> numbers) const;

  // True, by part, if it has changed by more than a share of its volume.
  std::vector<std::uint8_t> beyond(double share, std::span<const double> changes) const;

  // Triangles of the mesh whose collapses and moves have taken most from the parts that lack more
  // than that share of their volume, or given most to those that have too much: so many that
  // undoing them makes up for it.
  std::vector<std::uint32_t> to_undo(double share, std::span<const double> changes,
                                     const Mesh& mesh, const History& history,
                                     std::span<const Vec3> places) const;

 private:
  void find_sizes(const Mesh& mesh);
  template <class Sides>
  std::vector<double> volumes(const SurfaceView& view, Sides sides_of) const;

  std::span<const WallSides> sides_;
  std::vector<Point> middles_;   // of each part
  std::vector<double> sizes_;    // that shares are of
  std::vector<double> volumes_;  // cubic millimetres
};

}  // namespace isomesh::mesh::collapse
