#include "server/mesh/measure/join_equal.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace isomesh::mesh {

void join_equal(std::span<const Vec3> positions, std::span<Triangle> triangles) {
  std::vector<bool> is_named(positions.size());
  for (const Triangle& triangle : triangles) {
    for (const std::uint32_t vertex : triangle) is_named[vertex] = true;
  }
  std::vector<std::uint32_t> order;
  for (std::size_t v = 0; v < positions.size(); ++v) {
    if (is_named[v]) order.push_back(static_cast<std::uint32_t>(v));
  }
  std::ranges::sort(order, [&](std::uint32_t a, std::uint32_t b) {
    return positions[a] != positions[b] ? positions[a] < positions[b] : a < b;
  });
  std::vector<std::uint32_t> joined(positions.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool is_same = i > 0 && positions[order[i]] == positions[order[i - 1]];
    joined[order[i]] = is_same ? joined[order[i - 1]] : order[i];
  }
  for (Triangle& triangle : triangles) {
    for (std::uint32_t& vertex : triangle) vertex = joined[vertex];
  }
}

}  // namespace isomesh::mesh
