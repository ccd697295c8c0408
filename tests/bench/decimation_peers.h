// Other programs' simplification; without VTK there is none of it.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "server/mesh/surface_view.h"

namespace isomesh::bench {

struct Decimated {
  std::vector<mesh::Vec3> positions;
  std::vector<mesh::Triangle> triangles;
};

struct DecimationPeer {
  std::string name;
  // To about that many triangles; `run` is all that is timed.
  Decimated (*run)(const mesh::SurfaceView& surface, std::size_t triangles);
};

// Those that were found when this was built.
std::vector<DecimationPeer> decimation_peers();

}  // namespace isomesh::bench
