// Moves of vertices along the surface that raise angles, several vertices at a time; private to
// this folder. Compiled for several instruction sets; the best one is chosen at run time.
#pragma once

#include <cstdint>
#include <span>

#include "server/mesh/mesh.h"
#include "server/mesh/smooth/methods.h"
#include "server/mesh/smooth/rings.h"

namespace isomesh::mesh {

// The arrays that all moves of a mesh share.
struct FanMoves {
  const Rings& rings;
  const Vec3* extracted;   // where the vertices were before the first pass
  Vec3* positions;         // where they are
  std::uint32_t* home;     // for each, the vertex whose extracted triangles it lies on
  float max_displacement;  // from the extracted position
};

// Moves the vertices, which have rings and of which no two are neighbours. Thread safe if no other
// thread moves them or their neighbours meanwhile.
void move_fans(const FanMoves& moves, Move move, std::span<const std::uint32_t> vertices);

}  // namespace isomesh::mesh
