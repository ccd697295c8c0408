#include "server/mesh/measure.h"

#include <algorithm>
#include <numeric>
#include <span>
#include <vector>

#include "server/mesh/extent-inl.h"

namespace isomesh::mesh {
namespace {

// Layers that a task works on: of measure_topology more, because it looks at one of them twice.
constexpr std::size_t kLayersPerExtent = 4;
constexpr std::size_t kLayersPerTopology = 16;

// Disjoint sets of vertices, each known by its smallest member. Different threads may work on
// vertices that no set has in common.
class Components {
 public:
  explicit Components(std::size_t vertices) { parents_.resize_for_overwrite(vertices); }

  // Each of the vertices [begin, end) becomes a set of its own.
  void begin_sets(std::uint64_t begin, std::uint64_t end) {
    std::iota(parents_.begin() + begin, parents_.begin() + end, static_cast<std::uint32_t>(begin));
  }

  // Makes one set of the triangles' corners, for each triangle; returns how many sets fewer there
  // are then.
  std::uint64_t join(std::span<const Triangle> triangles) {
    std::uint64_t joined = 0;
    for (const auto& [a, b, c] : triangles) {
      const std::uint32_t parent = parents_[a];
      if (parents_[b] == parent && parents_[c] == parent) continue;
      const std::uint32_t root_a = root(a);
      const std::uint32_t root_b = root(b);
      const std::uint32_t root_c = root(c);
      const std::uint32_t first = std::min({root_a, root_b, root_c});
      joined += (root_a != root_b ? 1 : 0) + (root_c != root_a && root_c != root_b ? 1 : 0);
      for (const std::uint32_t vertex : {root_a, root_b, root_c, a, b, c}) parents_[vertex] = first;
    }
    return joined;
  }

 private:
  std::uint32_t root(std::uint32_t vertex) {
    while (parents_[vertex] != vertex) {
      parents_[vertex] = parents_[parents_[vertex]];
      vertex = parents_[vertex];
    }
    return vertex;
  }

  Buffer<std::uint32_t> parents_;
};

std::span<const Triangle> triangles_of(const Mesh& mesh, std::size_t begin, std::size_t end) {
  const std::uint64_t first = mesh.layer_triangles[begin];
  return mesh.triangles.span().subspan(first, mesh.layer_triangles[end] - first);
}

// How many vertices of the layers lie on the boundary. In an oriented manifold the triangles around
// a vertex name each of its neighbours once as the next corner and once as the previous one, unless
// the vertex lies on the boundary: then the sums of both differ.
std::uint64_t count_boundary_vertices(const Mesh& mesh, std::size_t begin, std::size_t end) {
  const std::uint64_t first = mesh.layer_vertices[begin];
  std::vector<std::uint32_t> balance(mesh.layer_vertices[end] - first, 0);
  const auto add = [&](std::uint32_t vertex, std::uint32_t difference) {
    const std::uint64_t index = vertex - first;  // beyond the end for vertices before the first
    if (index < balance.size()) balance[index] += difference;
  };
  for (const auto& [a, b, c] : triangles_of(mesh, begin == 0 ? 0 : begin - 1, end)) {
    add(a, b - c);
    add(b, c - a);
    add(c, a - b);
  }
  return balance.size() - static_cast<std::uint64_t>(std::ranges::count(balance, std::uint32_t{0}));
}

}  // namespace

Extent measure_extent(const Mesh& mesh, const Context& context) {
  std::vector<LayerExtent> layers(mesh.layers());
  const std::size_t tasks = (layers.size() + kLayersPerExtent - 1) / kLayersPerExtent;
  parallel_for(context, tasks, [&](std::size_t task) {
    const std::size_t end = std::min(layers.size(), (task + 1) * kLayersPerExtent);
    for (std::size_t layer = task * kLayersPerExtent; layer < end; ++layer) {
      for (std::size_t v = mesh.layer_vertices[layer]; v < mesh.layer_vertices[layer + 1]; ++v) {
        layers[layer].add_vertex(load(mesh.positions[v]));
      }
      add_triangles(mesh, layer, layers[layer]);
    }
  });
  LayerExtent whole;
  for (const LayerExtent& layer : layers) whole.add(layer);
  return whole.extent();
}

Topology measure_topology(const Mesh& mesh, const Context& context) {
  const std::size_t layers = mesh.layers();
  const std::size_t tasks = (layers + kLayersPerTopology - 1) / kLayersPerTopology;
  const auto end_of = [&](std::size_t task) {
    return std::min(layers, (task + 1) * kLayersPerTopology);
  };
  Components components(mesh.positions.size());
  std::vector<std::uint64_t> joined(tasks);
  std::vector<std::uint64_t> boundary(tasks);
  parallel_for(context, tasks, [&](std::size_t task) {
    const std::size_t begin = task * kLayersPerTopology;
    const std::size_t end = end_of(task);
    components.begin_sets(mesh.layer_vertices[begin], mesh.layer_vertices[end]);
    // All triangles that name no vertex of the next task's.
    joined[task] = components.join(triangles_of(mesh, begin, end == layers ? end : end - 1));
    boundary[task] = count_boundary_vertices(mesh, begin, end);
  });

  Topology topology;
  topology.components = mesh.positions.size();
  for (std::size_t task = 0; task < tasks; ++task) {
    const std::size_t end = end_of(task);
    if (end < layers) joined[task] += components.join(triangles_of(mesh, end - 1, end));
    topology.components -= joined[task];
    // Of a manifold's boundary, as many edges leave every vertex as reach it: one.
    topology.boundary_edges += boundary[task];
  }
  const std::uint64_t edges = (3 * mesh.triangles.size() + topology.boundary_edges) / 2;
  topology.euler = static_cast<std::int64_t>(mesh.positions.size()) -
                   static_cast<std::int64_t>(edges) +
                   static_cast<std::int64_t>(mesh.triangles.size());
  return topology;
}

}  // namespace isomesh::mesh
