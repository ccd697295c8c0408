// Moves the vertices of a simplified surface so that it keeps its volume; private to this folder.
//
// A round surface whose vertices are only removed becomes smaller, because chords remain. So each
// vertex moves along its normal by the volume that its surroundings lost. Vertices of junction
// curves move by least squares over their walls. P. Lindstrom and G. Turk place the vertex of each
// collapse in the plane that keeps the volume ("Fast and memory efficient polygonal
// simplification", IEEE Visualization 1998). Here all vertices move at the end, so collapses that
// are undone later need no places of their own.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/mesh/collapse/history.h"
#include "server/mesh/context.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh::collapse {

// The largest turn of a triangle by moved vertices, as a cosine.
inline constexpr double kLeastCosineOfMoves = 0.5;

// Moves vertices of the mesh, whose collapses are in `history`, from these places. Those that are
// gone, on a cap, or at the end of an open surface and beside it stay, as do those of junction
// curves without `sides`. `is_held`: of each vertex, whether it only moves back, where a triangle
// turns; empty if none is. None moves across a cap. No other goes farther than `most_mm` from its
// own place, nor than half the length of its shortest edge, and no triangle turns farther than
// kLeastCosineOfMoves or loses its area. `sides`: of the mesh's triangles, empty if all are of one
// wall. Each wall keeps the volume on its sides, as far as these limits allow. The same for any
// number of threads. Throws Error kCancelled, and kTooLarge if 32 bits cannot number all corners.
void keep_volume(const Mesh& mesh, std::span<const WallSides> sides, const History& history,
                 std::span<const std::uint8_t> is_held, double most_mm, const Context& context,
                 std::vector<Vec3>& places);

// True if moved corners turn a triangle of the mesh's vertices too far, or leave it no area.
bool is_turned(const Mesh& mesh, std::span<const Vec3> places, const Triangle& corners);

}  // namespace isomesh::mesh::collapse
