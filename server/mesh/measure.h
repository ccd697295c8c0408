// Numbers about a mesh: size, extent and topology.
#pragma once

#include <array>
#include <cstdint>

#include "server/mesh/context.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh {

struct Extent {
  double area_mm2 = 0;
  double volume_mm3 = 0;  // signed; an open surface is closed by the cone to mesh.origin
  std::array<double, 3> low = {0, 0, 0};  // bounds; zero for an empty mesh
  std::array<double, 3> high = {0, 0, 0};
};

struct Topology {
  std::uint64_t boundary_edges = 0;
  std::uint64_t components = 0;
  std::int64_t euler = 0;  // vertices - edges + triangles
};

// Deterministic for any number of threads: layers are summed in order. Throws Error kCancelled.
Extent measure_extent(const Mesh& mesh, const Context& context);

// For an oriented manifold such as extract_surface makes. Throws Error kCancelled.
Topology measure_topology(const Mesh& mesh, const Context& context);

}  // namespace isomesh::mesh
