// The topology of a mesh, combined from what is known of its parts.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "server/mesh/context.h"
#include "server/mesh/mesh.h"
#include "server/mesh/topology/topology.h"

namespace isomesh::mesh {

// Facts about some of a mesh's triangles, collected by code that visits them for another purpose.
// Each vertex that they name is either inner or of the rim. Inner means that those triangles that
// name it are one closed fan, in which each neighbour is next once and previous once.
struct PartTopology {
  // A triangle at a vertex of the rim, which continues to `next` and comes from `previous`.
  struct RimCorner {
    std::uint32_t vertex = 0;
    std::uint32_t next = 0;
    std::uint32_t previous = 0;
  };
  // A component of the part at a vertex of the rim.
  struct RimVertex {
    std::uint32_t vertex = 0;
    std::uint32_t component = 0;
  };

  std::uint64_t first_word = 0;      // of `inner`, in words of 64 vertices of the mesh
  std::vector<std::uint64_t> inner;  // a bit each
  std::vector<RimCorner> rim;
  std::uint32_t components = 0;
  std::vector<RimVertex> rim_components;  // all that exist at each vertex of the rim
};

// The topology of the mesh whose triangles the parts have, each in exactly one part. Empty if the
// facts do not suffice: another part names a vertex that is inner in one, or a vertex of the rim
// has no component. Equals measure_topology, but takes only the time of the rims. Throws Error
// kCancelled.
std::optional<Topology> join_topology(const Mesh& mesh, std::span<const PartTopology> parts,
                                      const Context& context);

}  // namespace isomesh::mesh
