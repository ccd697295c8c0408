// One block of a surface that is simplified; private to this folder.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/mesh/mesh.h"
#include "server/mesh/separate.h"
#include "server/mesh/triangle_grid.h"

namespace isomesh::mesh {

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

// Some triangles of a mesh on its way to fewer, and what has to stay near them.
struct SurfaceBlock {
  std::vector<Triangle> triangles;  // vertices of the mesh
  WallSides sides = {};             // of all of them, where they are walls
  // The original's points that these triangles are near, and which of them each.
  std::vector<std::uint32_t> points;
  std::vector<std::uint32_t> homes;
};

struct BlockGoal {
  const Mesh& mesh;  // whose vertices are taken
  // What the distances are from: the mesh's triangles, with its vertices as they were before.
  SurfaceView original;
  const TriangleGrid* grid = nullptr;  // of the original; none where nothing is measured
  double max_error_mm = 0;
  double share = 0;  // of the triangles, that is aimed at
};

struct BlockOutcome {
  std::uint32_t repeated = 0;
  bool is_taken_back = false;
};

// Replaces the triangles by fewer, and the homes by those among them. Edges that only one of the
// triangles has stay, and so do the vertices of Mesh::on_line, and those that are held and their
// neighbours. Thread safe for different blocks.
BlockOutcome simplify_block(const BlockGoal& goal, std::span<const std::uint32_t> held,
                            SurfaceBlock& block);

// An edge between two vertices of the block's own boundary, of which other blocks may have
// triangles too.
struct SeamEdge {
  std::uint32_t low = 0;  // vertices of the mesh
  std::uint32_t high = 0;
  std::uint32_t triangles = 0;  // of this block
};

// All of them.
std::vector<SeamEdge> seam_edges(std::span<const Triangle> triangles);

}  // namespace isomesh::mesh
