// The topology of a surface that is seen window by window.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/mesh/context.h"
#include "server/mesh/mesh.h"
#include "server/mesh/topology/topology.h"

namespace isomesh::mesh {

// As many layers are looked at together: with more, fewer are looked at twice; with fewer, their
// lists fit into the cache.
constexpr std::size_t kLayersPerPart = 4;

// Facts about a window of a mesh (LayerSource::write), found on its triangles and on those of
// the layer below it. These have the window's numbers, modulo 2^32. Thread safe.
struct WindowTopology {
  WindowTopology(const Mesh& window, std::span<const Triangle> below, const Context& context);
  // The memory in which it is found, beside the window, if kLayersPerPart layers have no more than
  // `vertices`; an upper bound.
  static std::uint64_t bytes(std::uint64_t vertices);

  Topology fans;                 // of the window's own vertices
  std::uint32_t components = 0;  // of all its vertices
  // The component of each vertex of the first layer, and of the one behind the window.
  std::vector<std::uint32_t> first;
  std::vector<std::uint32_t> behind;
};

// The topology of a mesh from its windows, in their order. Holds what one layer needs.
class TopologySum {
 public:
  void add(const WindowTopology& window);

  // Equals measure_topology's, of a mesh of that size.
  Topology result(std::uint64_t vertices, std::uint64_t triangles) const;

 private:
  Topology sum_;
  std::vector<std::uint32_t> behind_;  // the component of each vertex, below `open_`
  std::uint32_t open_ = 0;
};

}  // namespace isomesh::mesh
