// Fewer triangles for a surface, within a distance of it.
//
// Edges collapse in the order of their quadrics (M. Garland, P. S. Heckbert, "Surface
// simplification using quadric error metrics", SIGGRAPH 1997). A vertex is drawn into a neighbour.
// A quadric is no distance. So before each collapse some points are measured against the original
// surface in both directions, and the link condition is checked. Then the vertices that are left
// move so that the surface keeps its volume (kept_volume.h). In the end all points are looked at
// (misses.h), and vertices move back where that is needed. Others make up for these, and where they
// cannot, collapses are undone (part_volumes.h).
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
  // than this from the other, and no point at all if the effect says so. Millimetres, more than 0.
  // Infinite: nothing is measured.
  double max_error_mm = std::numeric_limits<double>::infinity();
  // The vertex positions before they were moved, in the mesh's order. The error is measured from
  // that surface. Empty: the current positions. No vertex may have moved farther than the error.
  std::span<const Vec3> before = {};
  // Target triangle count. 0: as few as the error allows.
  std::uint64_t triangles = 0;
  // Vertices that are left move so that the surface keeps its volume. Of walls, each part
  // (label_parts.h) keeps 99.7 % of its own, if that takes no more triangles than a target count,
  // or than a fourth more without one, and ten further rounds of repairs suffice. False: they stay
  // where they are, so all places are those of the surface as it was.
  bool keeps_volume = true;
};

struct SimplificationEffect {
  std::uint64_t triangles_before = 0;
  std::uint64_t triangles_after = 0;
  // True if the target count was reached, or if there was none.
  bool reached_triangles = true;
  // True if the target was not reached because no further edge can collapse, whatever the error.
  bool is_least = false;
  // True if the error holds for every point of both surfaces, wall by wall; false without one, too.
  bool is_within = false;
};

// Simplifies the mesh in place. The remaining vertices keep their order. All boundary vertices are
// kept where they are, those of caps stay where they are, and all of Mesh::on_line are kept if no
// walls are given. The others move where the volume needs it, if the options say so. An oriented
// manifold stays one, with the same boundary, Euler characteristic and orientation. No two
// triangles lie back to back, so a closed surface has at least four. No triangle loses its area.
// None that changed intersects another one, unless there is no error and only so the target can be
// reached. The layers are joined into fewer, deeper ones, so that a triangle names vertices of at
// most two. Encoders walk along these layers.
//
// Takes some 100 bytes a triangle beside the mesh, and what TriangleGrid takes. Keeping the volume
// takes 20 bytes a triangle of the mesh, and some 130 of each that is left. The same mesh for any
// number of threads. Throws Error kUnusableVolume where a position is not a finite number,
// kTooLarge where 32 bits cannot number the points that are measured, and kCancelled; the mesh is
// as it was then.
SimplificationEffect simplify(const SimplifyOptions& options, const Context& context, Mesh& mesh);

// Simplifies the walls between labels. Each wall is simplified once, for both its sides, and keeps
// its sides. Each junction curve is simplified once, for all walls that meet there. The points
// where junction curves meet stay. Each label's own surface keeps the properties listed above.
SimplificationEffect simplify(const SimplifyOptions& options, const Context& context,
                              SeparatingSurface& walls);

}  // namespace isomesh::mesh
