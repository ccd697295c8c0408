// Fewer triangles for a surface, within a distance of it that is measured.
//
// What may go is proposed by libmeshoptimizer, whose edge collapses leave vertices where they are
// and out; its error is a quadric's (M. Garland, P. S. Heckbert, "Surface simplification using
// quadric error metrics", SIGGRAPH 1997), not a distance. So each proposal is measured against the
// surface as it was, both ways, and looked at as a surface; where it is too far off or no manifold,
// its vertices are held and it is made again, in the end for less.
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
  // The positions of the mesh's vertices before smoothing, in their order. The error is measured
  // from this surface. Empty: the present positions. No vertex may have moved farther than the
  // error.
  std::span<const Vec3> before = {};
  // The target number; blocks remove about equal shares. 0: as few as the error allows.
  std::uint64_t triangles = 0;
};

struct SimplificationEffect {
  std::uint64_t triangles_before = 0;
  std::uint64_t triangles_after = 0;
  // Blocks of triangles that were simplified in all rounds, how many proposals for them were made
  // again, and how many of them were left as they were in the end.
  std::uint64_t blocks = 0;
  std::uint64_t repeated = 0;
  std::uint64_t taken_back = 0;
  // Whether there are as few triangles as was aimed at; true where nothing was.
  bool reached_triangles = true;
  // True if the topology needs all triangles that are left, whatever the error.
  bool is_least = false;
};

// Simplifies the mesh in place. Its vertices are some of those that it had, in the same order and
// at the same places; those on a boundary are all kept, and of Mesh::on_line where no walls are
// given. What is an
// oriented manifold stays one, of the same boundary, Euler characteristic and orientation, and no
// two triangles lie back to back: a closed surface has four at least. No triangle has an area of
// zero that had one before. The layers are joined into fewer, deeper ones:
// as few as let a triangle name vertices of two at most, which is what the encoders walk along.
//
// Takes some 100 bytes a triangle beside the mesh, and what TriangleGrid takes. The same mesh for
// any number of threads. Throws Error kUnusableVolume where a position is not a finite number,
// kTooLarge where 32 bits cannot number the points that are measured, and kCancelled; the mesh is
// as it was then.
SimplificationEffect simplify(const SimplifyOptions& options, const Context& context, Mesh& mesh);

// As above, for the walls between labels: each is simplified once, for both its sides, and keeps
// them, and so is each line where walls meet, for all of them; the points where lines meet stay.
// As above, for the surface of each label.
SimplificationEffect simplify(const SimplifyOptions& options, const Context& context,
                              SeparatingSurface& walls);

}  // namespace isomesh::mesh
