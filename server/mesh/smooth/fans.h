// Moves of vertices that raise the angles around them, several vertices at a time; compiled for
// several instruction sets of which the best is chosen when the program runs; private to this
// folder.
#pragma once

#include <cstdint>
#include <span>

#include "server/mesh/mesh.h"
#include "server/mesh/smooth/rings.h"

namespace isomesh::mesh {

// The arrays that all moves of a mesh share.
struct FanMoves {
  const Rings& rings;
  const Vec3* extracted;   // where the vertices were before the first pass
  Vec3* positions;         // where they are
  std::uint32_t* home;     // of each, the vertex whose extracted triangles it lies on
  float max_displacement;  // from the extracted position
};

enum class FanMove { kMean, kAngle, kOptimize };

// Moves the vertices, which have rings and of which no two are neighbours. Thread safe as long as
// none of them or of their neighbours is moved meanwhile.
void move_fans(const FanMoves& moves, FanMove move, std::span<const std::uint32_t> vertices);

}  // namespace isomesh::mesh
