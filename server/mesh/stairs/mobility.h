// Finds where walls are staircases; private to this folder.
#pragma once

#include <cstdint>
#include <vector>

#include "server/mesh/stairs/wall_shape.h"

namespace isomesh::mesh {

// One value per vertex for `moves`, `owes`, `spread` and `calm`, all between 0 and 1.
struct Mobility {
  std::vector<float> moves;  // the share of a step of smoothing
  std::vector<float> owes;   // the share of an offset that puts volume back
  // Spacing along the normal, of the largest: the diffusivity that uneven spacing asks for.
  std::vector<float> spread;
  std::vector<float> calm;  // 0 where junctions crowd together as noise makes them

  std::vector<std::uint32_t> moving;  // vertices of which moves > 0
  std::vector<std::uint32_t> walls;   // those of them that are on no curve
  std::vector<std::uint32_t> curves;  // all vertices on curves
  std::vector<std::uint32_t> moving_curves;
  std::vector<std::uint32_t> beside;  // others within five edges of a curve
};

// Computes the mobility from the walls before they are moved. Throws Error kCancelled.
Mobility find_mobility(const WallShape& shape, const Context& context);

}  // namespace isomesh::mesh
