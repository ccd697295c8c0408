// Removes the self-intersections that smoothing made.
//
// The vertices of two triangles that intersect move half of the way back to where they were
// extracted, all from the same positions. Then the triangles around these vertices are looked at
// again, until none intersect. After a few halves a vertex stands exactly where it was extracted,
// so this ends, at worst with the extracted surface.
#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "server/mesh/context.h"
#include "server/mesh/extract/extract.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh {

// Of files that round coordinates.
struct Rounding {
  std::function<Vec3(const Vec3&)> rounded;  // the position that they have for a vertex
  double most_mm = 0;                        // how far that is from it along an axis, at most
};

struct UntangleOptions {
  std::span<const Vec3> extracted;  // the position of each vertex before smoothing, in millimetres
  bool is_exact = true;             // the positions themselves must not intersect
  // If files round: their rounding of a mesh with such bounds. Then the rounded triangles must not
  // intersect either. Vertices that are rounded to one place are one there.
  std::function<Rounding(const Mesh&)> rounding = {};
};

struct UntangleEffect {
  std::uint64_t pairs = 0;     // of triangles that intersected, in some positions
  std::uint64_t vertices = 0;  // that were moved
  // The pairs that are left: all their vertices stand where they were extracted, so the extracted
  // triangles intersect each other.
  std::uint64_t left = 0;
  double mean_displacement_mm = 0;  // from the extracted positions; of all vertices
  double max_displacement_mm = 0;
};

// Untangles the mesh in place: a surface or walls that were smoothed. A vertex never moves away
// from there. Vertices that smoothing has left there stay. Self-intersections are those of
// measure/self_intersections.h; a triangle that loses its area counts as one. The result does not
// depend on the number of threads. Throws as find_self_intersections; the positions are
// indeterminate after kCancelled.
UntangleEffect untangle(const UntangleOptions& options, const Context& context, Mesh& mesh);

// An upper bound of the memory that `untangle` takes beside the mesh and the extracted positions,
// in bytes, however many triangles intersect.
std::uint64_t untangling_memory(const SurfaceSize& size);

}  // namespace isomesh::mesh
