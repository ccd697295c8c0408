// The topology of a mesh from what is known of its parts, each looked at by itself.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "server/mesh/context.h"
#include "server/mesh/mesh.h"
#include "server/mesh/topology/topology.h"

namespace isomesh::mesh {

// What is known of some of a mesh's triangles, for whoever has walked over all of them for another
// purpose. Each vertex that they name is either inner, which means that those of them that name it
// are one closed fan, in which each neighbour is next once and previous once; or it is of the rim.
struct PartTopology {
  // A triangle at a vertex of the rim, which runs on from there to `next` and comes from
  // `previous`.
  struct RimCorner {
    std::uint32_t vertex = 0;
    std::uint32_t next = 0;
    std::uint32_t previous = 0;
  };
  // One of the part's components at a vertex of the rim.
  struct RimVertex {
    std::uint32_t vertex = 0;
    std::uint32_t component = 0;
  };

  std::uint64_t first_word = 0;      // of `inner`, in words of 64 vertices of the mesh
  std::vector<std::uint64_t> inner;  // a bit each
  std::vector<RimCorner> rim;        // all of them
  std::uint32_t components = 0;
  std::vector<RimVertex> rim_components;  // all there are at each vertex of the rim
};

// The topology of the mesh whose triangles the parts have between them, each in one part. None
// where it does not follow from what is known: when a vertex that is inner in one part is named by
// another one, or a vertex of the rim has no component. Same as measure_topology, in time of the
// rims alone. Throws Error kCancelled.
std::optional<Topology> join_topology(const Mesh& mesh, std::span<const PartTopology> parts,
                                      const Context& context);

}  // namespace isomesh::mesh
