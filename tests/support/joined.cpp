#include "tests/support/joined.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <set>

#include "tests/support/mesh_checks.h"

namespace isomesh::test {
namespace {

// The triangles of each connected component, by the smallest of its vertices.
std::map<std::uint32_t, std::vector<mesh::Triangle>> split(
    std::span<const mesh::Triangle> triangles, std::size_t vertices) {
  std::vector<std::uint32_t> root(vertices);
  std::iota(root.begin(), root.end(), 0U);
  const auto find = [&](std::uint32_t v) {
    while (root[v] != v) v = root[v] = root[root[v]];
    return v;
  };
  for (const auto& [a, b, c] : triangles) {
    for (const std::uint32_t other : {b, c}) {
      const auto [low, high] = std::minmax({find(a), find(other)});
      root[high] = low;
    }
  }
  std::map<std::uint32_t, std::vector<mesh::Triangle>> components;
  for (const mesh::Triangle& triangle : triangles) {
    components[find(triangle[0])].push_back(triangle);
  }
  return components;
}

TopologyFacts facts_of(const std::vector<mesh::Triangle>& triangles) {
  Surface surface;
  std::map<std::uint32_t, std::uint32_t> numbers;
  for (mesh::Triangle triangle : triangles) {
    for (std::uint32_t& v : triangle) {
      v = numbers.try_emplace(v, static_cast<std::uint32_t>(numbers.size())).first->second;
    }
    surface.triangles.push_back(triangle);
  }
  surface.points.resize(numbers.size());
  return topology_of(surface);
}

bool is_manifold(const TopologyFacts& facts) {
  return facts.crowded_edges + facts.misoriented_edges + facts.pinched_vertices +
             facts.repeating_triangles + facts.unused_vertices ==
         0;
}

}  // namespace

std::vector<std::uint32_t> joined_to(const mesh::Mesh& regular, const mesh::Mesh& plain,
                                     std::span<const std::uint32_t> clusters) {
  std::vector<std::uint32_t> to(plain.positions.size(), kNotJoined);
  std::map<std::uint32_t, std::uint32_t> cluster_to;
  std::size_t next = 0;
  for (std::size_t layer = 0; layer < plain.layers(); ++layer) {
    if (next != regular.layer_triangles[layer]) return {};
    for (const mesh::Triangle& triangle : plain.triangles_of(layer, layer + 1)) {
      const auto joined = [&](std::size_t i, std::size_t j) {
        return clusters[triangle[i]] != kNotJoined &&
               clusters[triangle[i]] == clusters[triangle[j]];
      };
      if (joined(0, 1) || joined(1, 2) || joined(2, 0)) continue;
      if (next == regular.triangles.size()) return {};
      const mesh::Triangle& kept = regular.triangles[next++];
      for (std::size_t i = 0; i < 3; ++i) {
        const std::uint32_t cluster = clusters[triangle[i]];
        std::uint32_t& place = cluster == kNotJoined
                                   ? to[triangle[i]]
                                   : cluster_to.try_emplace(cluster, kNotJoined).first->second;
        if (place != kNotJoined && place != kept[i]) return {};
        place = kept[i];
      }
    }
  }
  if (next != regular.triangles.size()) return {};
  for (std::size_t v = 0; v < to.size(); ++v) {
    if (clusters[v] != kNotJoined && cluster_to.contains(clusters[v]))
      to[v] = cluster_to[clusters[v]];
  }
  return to;
}

testing::AssertionResult has_topology(std::span<const mesh::Triangle> regular,
                                      std::span<const mesh::Triangle> plain,
                                      std::span<const std::uint32_t> to) {
  std::uint32_t most = 0;
  for (const std::uint32_t v : to) most = std::max(most, v == kNotJoined ? 0 : v);
  const auto before = split(plain, to.size());
  const auto after = split(regular, std::size_t{most} + 1);
  if (before.size() != after.size()) {
    return testing::AssertionFailure()
           << after.size() << " components instead of " << before.size();
  }
  std::map<std::uint32_t, std::uint32_t> component_of;  // of each regular vertex
  for (const auto& [root, triangles] : after) {
    for (const mesh::Triangle& triangle : triangles) {
      for (const std::uint32_t v : triangle) component_of[v] = root;
    }
  }
  for (const auto& [root, triangles] : before) {
    std::set<std::uint32_t> became;
    for (const mesh::Triangle& triangle : triangles) {
      for (const std::uint32_t v : triangle) became.insert(component_of[to[v]]);
    }
    if (became.size() != 1) return testing::AssertionFailure() << "a component was torn";
    const TopologyFacts old = facts_of(triangles);
    const TopologyFacts now = facts_of(after.at(*became.begin()));
    if (!is_manifold(now)) return testing::AssertionFailure() << "a component is no manifold";
    if (now.euler != old.euler || now.boundary_loops != old.boundary_loops) {
      return testing::AssertionFailure()
             << "a component of Euler number " << old.euler << " and " << old.boundary_loops
             << " boundary curves has " << now.euler << " and " << now.boundary_loops;
    }
  }
  std::set<mesh::Triangle> corners;
  for (mesh::Triangle triangle : regular) {
    std::ranges::sort(triangle);
    if (!corners.insert(triangle).second) {
      return testing::AssertionFailure() << "two triangles have the same corners";
    }
  }
  if (!is_manifold(facts_of({regular.begin(), regular.end()}))) {
    return testing::AssertionFailure() << "it is no manifold";
  }
  return testing::AssertionSuccess();
}

}  // namespace isomesh::test
