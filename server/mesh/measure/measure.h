// The size of a mesh.
#pragma once

#include <array>

#include "server/mesh/context.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh {

struct Extent {
  double area_mm2 = 0;
  double volume_mm3 = 0;  // signed; an open surface is closed by the cone to mesh.origin
  std::array<double, 3> low = {0, 0, 0};  // bounds; zero for an empty mesh
  std::array<double, 3> high = {0, 0, 0};
};

// Deterministic for any number of threads: layers are summed in order. Throws Error kCancelled.
Extent measure_extent(const Mesh& mesh, const Context& context);

}  // namespace isomesh::mesh
