#include "server/mesh/topology/vertex_fans.h"

#include <algorithm>
#include <vector>

namespace isomesh::mesh {
namespace {

// How often a neighbour is next and previous, and the smallest neighbour in its fan.
struct Neighbor {
  std::uint32_t vertex;
  std::uint32_t next = 0;
  std::uint32_t previous = 0;
  std::size_t fan = 0;
};

}  // namespace

std::size_t check_vertex(std::span<const Corner> corners, Topology& topology) {
  std::vector<Neighbor> neighbors;
  for (const Corner& corner : corners) {
    neighbors.push_back({.vertex = corner.next});
    neighbors.push_back({.vertex = corner.previous});
  }
  std::ranges::sort(neighbors, {}, &Neighbor::vertex);
  const auto is_same = [](const Neighbor& a, const Neighbor& b) { return a.vertex == b.vertex; };
  neighbors.erase(std::unique(neighbors.begin(), neighbors.end(), is_same), neighbors.end());
  const auto find = [&](std::uint32_t vertex) {
    return std::ranges::lower_bound(neighbors, vertex, {}, &Neighbor::vertex);
  };
  for (std::size_t n = 0; n < neighbors.size(); ++n) neighbors[n].fan = n;
  for (const Corner& corner : corners) {
    const auto next = find(corner.next);
    const auto previous = find(corner.previous);
    ++next->next;
    ++previous->previous;
    if (next == previous) topology.manifold = false;  // a triangle names a vertex twice
    const std::size_t joined = std::min(next->fan, previous->fan);
    const std::size_t other = std::max(next->fan, previous->fan);
    for (Neighbor& neighbor : neighbors) {
      if (neighbor.fan == other) neighbor.fan = joined;
    }
  }
  std::size_t fans = 0;
  for (std::size_t n = 0; n < neighbors.size(); ++n) {
    const Neighbor& neighbor = neighbors[n];
    if (neighbor.fan == n) ++fans;
    if (neighbor.next + neighbor.previous > 2 || neighbor.fan != 0) topology.manifold = false;
    if (neighbor.next > 1 || neighbor.previous > 1) topology.oriented = false;
    // Counted at the vertex where the edge begins, and not at its end.
    if (neighbor.next == 1 && neighbor.previous == 0) ++topology.boundary_edges;
  }
  return fans;
}

}  // namespace isomesh::mesh
