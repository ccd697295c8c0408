#include "server/codec/draco/part_topology.h"

namespace isomesh::codec::edgebreaker {

mesh::PartTopology part_topology(const Connectivity& surface,
                                 const std::vector<std::vector<Corner>>& boundary, const Fans& fans,
                                 const Traversal& traversal) {
  const std::vector<Vertex>& originals = fans.originals();
  const auto vertices = surface.vertices - static_cast<Vertex>(originals.size());
  const auto original = [&](Vertex vertex) {
    return vertex < vertices ? vertex : originals[vertex - vertices];
  };
  mesh::PartTopology part;
  part.inner.assign((vertices + 63) / 64, ~std::uint64_t{0});
  if (vertices % 64 != 0) part.inner.back() = (std::uint64_t{1} << vertices % 64) - 1;
  fans.for_each_on_boundary([&](Vertex vertex) {
    if (vertex < vertices) part.inner[vertex / 64] &= ~(std::uint64_t{1} << vertex % 64);
  });
  for (const std::vector<Corner>& corners : boundary) {
    for (const Corner outer : corners) {
      // Each open fan begins at a boundary edge.
      for (Corner corner = next(outer);;) {
        part.rim.push_back({original(surface.vertex(corner)),
                            original(surface.vertex(next(corner))),
                            original(surface.vertex(previous(corner)))});
        const Corner across = surface.opposite(next(corner));
        if (across == surface.none) break;
        corner = next(across);
      }
    }
  }
  part.components = traversal.components();
  part.rim_components.reserve(traversal.rim().size());
  for (const auto& [vertex, component] : traversal.rim()) {
    part.rim_components.push_back({original(vertex), component});
  }
  return part;
}

}  // namespace isomesh::codec::edgebreaker
