#include "server/mesh/topology/topology.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <span>
#include <vector>

#include "server/mesh/parallel.h"
#include "server/mesh/topology/components.h"
#include "server/mesh/topology/vertex_fans.h"
#include "server/mesh/topology/window_topology.h"

namespace isomesh::mesh {
namespace {

// The corners of every vertex of a run of layers, which only triangles of the same layers and of
// the one below name. Those of vertex v are [ends[v - 1], ends[v]).
class CornerLists {
 public:
  CornerLists(const Mesh& mesh, std::size_t first_layer, std::size_t end_layer,
              std::span<const Triangle> below)
      : begin_(mesh.layer_vertices[first_layer]),
        size_(mesh.layer_vertices[end_layer] - begin_),
        ends_(size_ + 1, 0) {
    if (first_layer > 0) below = mesh.triangles_of(first_layer - 1, first_layer);
    const std::array parts = {below, mesh.triangles_of(first_layer, end_layer)};
    // Shifted by one: while the lists are filled, an end is where its list continues.
    for (const auto& triangles : parts) {
      for (const Triangle& triangle : triangles) {
        for (const std::uint32_t vertex : triangle) {
          if (contains(vertex)) ++ends_[vertex - begin_ + 1];
        }
      }
    }
    std::uint32_t sum = 0;
    for (std::uint32_t& end : ends_) end = sum += end;
    corners_.resize_for_overwrite(sum);
    for (const auto& triangles : parts) {
      for (const auto& [a, b, c] : triangles) {
        add(a, {b, c});
        add(b, {c, a});
        add(c, {a, b});
      }
    }
  }

  std::size_t size() const { return size_; }

  std::span<const Corner> of(std::size_t v) const {
    const std::uint32_t begin = v == 0 ? 0 : ends_[v - 1];
    return {corners_.data() + begin, ends_[v] - begin};
  }

 private:
  bool contains(std::uint32_t vertex) const { return vertex - begin_ < size_; }

  void add(std::uint32_t vertex, const Corner& corner) {
    if (contains(vertex)) corners_[ends_[vertex - begin_]++] = corner;
  }

  const std::uint64_t begin_;
  const std::uint64_t size_;
  std::vector<std::uint32_t> ends_;
  Buffer<Corner> corners_;
};

// `below`: the triangles of the layer below the mesh's first.
Topology check_layers(const Mesh& mesh, std::size_t first_layer, std::size_t end_layer,
                      std::span<const Triangle> below) {
  Topology topology;
  FanWalk walk;
  const CornerLists lists(mesh, first_layer, end_layer, below);
  for (std::size_t v = 0; v < lists.size(); ++v) {
    const auto corners = lists.of(v);
    if (!walk.is_closed(corners)) check_vertex(corners, topology);
  }
  return topology;
}

void add(const Topology& part, Topology& whole) {
  whole.boundary_edges += part.boundary_edges;
  whole.manifold = whole.manifold && part.manifold;
  whole.oriented = whole.oriented && part.oriented;
}

// The fans of the first `layers` of the mesh.
Topology check_fans(const Mesh& mesh, std::size_t layers, std::span<const Triangle> below,
                    const Context& context) {
  std::vector<Topology> parts(chunks_of(layers, kLayersPerPart));
  const auto check = [&](std::size_t first, std::size_t end) {
    parts[first / kLayersPerPart] = check_layers(mesh, first, end, below);
  };
  for_chunks(context, layers, check, kLayersPerPart);
  Topology whole;
  for (const Topology& part : parts) add(part, whole);
  return whole;
}

std::int64_t euler_of(std::uint64_t vertices, std::uint64_t triangles,
                      std::uint64_t boundary_edges) {
  const std::uint64_t edges = (3 * triangles + boundary_edges) / 2;
  return static_cast<std::int64_t>(vertices) - static_cast<std::int64_t>(edges) +
         static_cast<std::int64_t>(triangles);
}

// Disjoint sets; each number points to a smaller one of its set, the smallest to itself.
std::uint32_t root_of(std::vector<std::uint32_t>& parents, std::uint32_t number) {
  while (parents[number] != number) number = parents[number] = parents[parents[number]];
  return number;
}

}  // namespace

Topology measure_topology(const Mesh& mesh, const Context& context) {
  Topology whole = check_fans(mesh, mesh.layers(), {}, context);
  whole.components = count_components(mesh, context);
  whole.euler = euler_of(mesh, whole.boundary_edges);
  return whole;
}

std::int64_t euler_of(const Mesh& mesh, std::uint64_t boundary_edges) {
  return euler_of(mesh.positions.size(), mesh.triangles.size(), boundary_edges);
}

WindowTopology::WindowTopology(const Mesh& window, std::span<const Triangle> below,
                               const Context& context)
    : fans(check_fans(window, window.layers() - 1, below, context)) {
  Components found;
  find_components(window, context, found);
  components = found.count;
  const auto of_layer = [&](std::size_t layer) {
    return std::vector<std::uint32_t>(found.of_vertex.begin() + window.layer_vertices[layer],
                                      found.of_vertex.begin() + window.layer_vertices[layer + 1]);
  };
  first = of_layer(0);
  behind = of_layer(window.layers() - 1);
}

std::uint64_t WindowTopology::bytes(std::uint64_t vertices) {
  // Six triangles, and the end of their list.
  constexpr std::uint64_t kPerVertex = 6 * sizeof(Corner) + sizeof(std::uint32_t);
  return block_bytes(vertices * kPerVertex);
}

// The layer behind a window is the first of the next: each of its vertices joins two components
// that may be one already.
void TopologySum::add(const WindowTopology& window) {
  mesh::add(window.fans, sum_);
  sum_.components += window.components;
  std::vector<std::uint32_t> parents(std::size_t{open_} + window.components);
  std::iota(parents.begin(), parents.end(), 0U);
  for (std::size_t v = 0; v < behind_.size(); ++v) {
    const std::uint32_t one = root_of(parents, behind_[v]);
    const std::uint32_t other = root_of(parents, open_ + window.first[v]);
    if (one == other) continue;
    parents[std::max(one, other)] = std::min(one, other);
    --sum_.components;
  }
  behind_ = window.behind;
  std::vector<std::uint32_t> numbers(parents.size(), UINT32_MAX);
  std::uint32_t open = 0;
  for (std::uint32_t& component : behind_) {
    std::uint32_t& number = numbers[root_of(parents, open_ + component)];
    if (number == UINT32_MAX) number = open++;
    component = number;
  }
  open_ = open;
}

Topology TopologySum::result(std::uint64_t vertices, std::uint64_t triangles) const {
  Topology result = sum_;
  result.euler = euler_of(vertices, triangles, result.boundary_edges);
  return result;
}

}  // namespace isomesh::mesh
