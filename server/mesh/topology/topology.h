// Topology of a mesh: closed, manifold, oriented, number of components.
#pragma once

#include <cstdint>

#include "server/mesh/context.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh {

// Found on the triangles alone, whatever made them; only the layers must be as in mesh.h. Edges are
// those of the triangles.
struct Topology {
  std::uint64_t boundary_edges = 0;  // of one triangle only
  std::uint64_t components = 0;      // that no triangle connects
  std::int64_t euler = 0;            // euler_of it
  // At most two triangles at an edge, and one fan of them around a vertex.
  bool manifold = true;
  bool oriented = true;  // no two triangles use an edge in the same direction

  bool operator==(const Topology&) const = default;
};

// Vertices - edges + triangles, of a mesh whose edges have at most two triangles.
std::int64_t euler_of(const Mesh& mesh, std::uint64_t boundary_edges);

// Does not depend on the number of threads. Throws Error kCancelled.
Topology measure_topology(const Mesh& mesh, const Context& context);

}  // namespace isomesh::mesh
