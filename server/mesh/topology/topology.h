// What a mesh is as a surface, whatever its shape: closed, manifold, oriented, of how many parts.
#pragma once

#include <cstdint>

#include "server/mesh/context.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh {

// What is found on the triangles alone, whoever made them; only the layers must be as mesh.h has
// them. Edges are those of the triangles.
struct Topology {
  std::uint64_t boundary_edges = 0;  // of one triangle only
  std::uint64_t components = 0;      // parts that no triangle connects
  std::int64_t euler = 0;            // euler_of it
  // At most two triangles at an edge, and one fan of them around a vertex.
  bool manifold = true;
  bool oriented = true;  // no two triangles run through an edge in the same direction

  bool operator==(const Topology&) const = default;
};

// Vertices - edges + triangles of a mesh without edges of more than two triangles.
std::int64_t euler_of(const Mesh& mesh, std::uint64_t boundary_edges);

// The same for any number of threads. Throws Error kCancelled.
Topology measure_topology(const Mesh& mesh, const Context& context);

}  // namespace isomesh::mesh
