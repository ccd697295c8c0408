// One block of a surface that is simplified; private to this folder.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/mesh/labels/separate.h"
#include "server/mesh/measure/triangle_grid.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh {

// The first request, as a share of the bound. A quadric's error is only a mean. Junction curves
// were simplified before, and the walls' own distance adds to theirs.
inline constexpr double kFirstError = 0.5;

// Keeps a distance that is measured again in single precision within the bound.
inline constexpr double kWithin = 1 - 1e-6;

// Some triangles of a mesh on its way to fewer, and what has to stay near them.
struct SurfaceBlock {
  std::vector<Triangle> triangles;  // vertices of the mesh
  std::vector<WallSides> sides;     // of each, where they are walls
  // The original's points that these triangles are near, and which of them each.
  std::vector<std::uint32_t> points;
  std::vector<std::uint32_t> homes;
};

struct BlockGoal {
  const Mesh& mesh;  // whose vertices are taken
  // Distances are measured from this surface: the mesh's triangles with the original positions.
  SurfaceView original;
  const TriangleGrid* grid = nullptr;  // of the original; none where nothing is measured
  double max_error_mm = 0;
  double share = 0;                         // of the triangles, that is aimed at
  std::span<const std::uint8_t> held = {};  // as SimplifyOptions

  bool holds(std::uint32_t vertex) const { return !held.empty() && held[vertex] != 0; }
};

// A block with vertices of its own, from 0 on.
struct LocalMesh {
  std::vector<std::uint32_t> origin;  // of each vertex, in the mesh; ascending
  std::vector<Vec3> positions;
  std::vector<Triangle> triangles;

  LocalMesh(const Mesh& mesh, std::span<const Triangle> block);

  Point at(std::uint32_t vertex) const { return to_point(positions[vertex]); }
  // The same triangle in the mesh's vertex numbers.
  Triangle in_mesh(const Triangle& triangle) const {
    return {origin[triangle[0]], origin[triangle[1]], origin[triangle[2]]};
  }
  Point normal(const Triangle& triangle) const {
    return normal_of(at(triangle[0]), at(triangle[1]), at(triangle[2]));
  }
  bool has_area(const Triangle& triangle) const { return normal(triangle) != Point{0, 0, 0}; }
};

struct BlockOutcome {
  std::uint32_t repeated = 0;
  bool is_taken_back = false;
};

// Replaces the triangles, all of one wall where they are walls, by fewer, and the homes by those
// among them. Edges that only one of the
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
