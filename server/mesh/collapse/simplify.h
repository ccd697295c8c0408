// Fewer triangles for a surface, within a distance of it that is measured.
//
// libmeshoptimizer proposes which edges to collapse. It removes vertices but never moves them. Its
// error is a quadric's (M. Garland, P. S. Heckbert, "Surface simplification using quadric error
// metrics", SIGGRAPH 1997), not a distance. So each proposal is measured against the original
// surface in both directions, and its topology is checked. If it is too far off or not a manifold,
// its vertices are held and a new proposal is made. After several attempts the new proposals reduce
// less.
#pragma once

#include <cstdint>
#include <limits>
#include <span>

#include "server/mesh/context.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh {

struct SimplifyOptions {
  // No vertex and no centre of a triangle, of the surface as it was and as it becomes, is farther
  // than this from the other. Millimetres, more than 0. Infinite: nothing is measured.
  double max_error_mm = std::numeric_limits<double>::infinity();
  // The vertex positions before they were moved, in the mesh's order. The error is measured from
  // that surface. Empty: the current positions. No vertex may have moved farther than the error.
  std::span<const Vec3> before = {};
  // Target triangle count, spread evenly over the blocks. 0: as few as the error allows.
  std::uint64_t triangles = 0;
  // A flag for each vertex of the mesh: it stays, on junction curves too. Empty: any may go.
  std::span<const std::uint8_t> held = {};
};

struct SimplificationEffect {
  std::uint64_t triangles_before = 0;
  std::uint64_t triangles_after = 0;
  // Blocks of triangles that were simplified in all rounds, how many proposals for them were made
  // again, and how many of them were left as they were in the end.
  std::uint64_t blocks = 0;
  std::uint64_t repeated = 0;
  std::uint64_t taken_back = 0;
  // True if the target count was reached, or if there was none.
  bool reached_triangles = true;
  // True if the target was not reached because no further edge can collapse, whatever the error.
  bool is_least = false;
  // True if the error holds for every point of both surfaces, wall by wall; false without one, too.
  bool is_within = false;
};

// Simplifies the mesh in place. The remaining vertices keep their order and positions. All boundary
// vertices are kept, and all of Mesh::on_line if no walls are given. An oriented manifold stays
// one, with the same boundary, Euler characteristic and orientation. No two triangles lie back to
// back, so a closed surface has at least four. No triangle loses its area. The layers are joined
// into fewer, deeper ones, so that a triangle names vertices of at most two. Encoders walk along
// these layers.
//
// Takes some 100 bytes a triangle beside the mesh, and what TriangleGrid takes. The same mesh for
// any number of threads. Throws Error kUnusableVolume where a position is not a finite number,
// kTooLarge where 32 bits cannot number the points that are measured, and kCancelled; the mesh is
// as it was then.
SimplificationEffect simplify(const SimplifyOptions& options, const Context& context, Mesh& mesh);

// Simplifies the walls between labels. Each wall is simplified once, for both its sides, and keeps
// its sides. Each junction curve is simplified once, for all walls that meet there. The points
// where junction curves meet stay. Each label's own surface keeps the properties listed above.
SimplificationEffect simplify(const SimplifyOptions& options, const Context& context,
                              SeparatingSurface& walls);

}  // namespace isomesh::mesh
