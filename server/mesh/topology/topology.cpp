#include "server/mesh/topology/topology.h"

#include <algorithm>
#include <span>
#include <vector>

#include "server/mesh/parallel.h"
#include "server/mesh/topology/components.h"
#include "server/mesh/topology/vertex_fans.h"

namespace isomesh::mesh {
namespace {

// Larger slabs look at fewer layers twice; the lists of smaller ones fit into the cache.
constexpr std::size_t kLayersPerPart = 4;

// The corners of every vertex of a run of layers, which only triangles of the same layers and of
// the one below name. Those of vertex v are [ends[v - 1], ends[v]).
class CornerLists {
 public:
  CornerLists(const Mesh& mesh, std::size_t first_layer, std::size_t end_layer)
      : begin_(mesh.layer_vertices[first_layer]),
        size_(mesh.layer_vertices[end_layer] - begin_),
        ends_(size_ + 1, 0) {
    const auto triangles = mesh.triangles_of(first_layer == 0 ? 0 : first_layer - 1, end_layer);
    // Shifted by one: while the lists are filled, an end is where its list continues.
    for (const Triangle& triangle : triangles) {
      for (const std::uint32_t vertex : triangle) {
        if (contains(vertex)) ++ends_[vertex - begin_ + 1];
      }
    }
    std::uint32_t sum = 0;
    for (std::uint32_t& end : ends_) end = sum += end;
    corners_.resize_for_overwrite(sum);
    for (const auto& [a, b, c] : triangles) {
      add(a, {b, c});
      add(b, {c, a});
      add(c, {a, b});
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

Topology check_layers(const Mesh& mesh, std::size_t first_layer, std::size_t end_layer) {
  Topology topology;
  FanWalk walk;
  const CornerLists lists(mesh, first_layer, end_layer);
  for (std::size_t v = 0; v < lists.size(); ++v) {
    const auto corners = lists.of(v);
    if (!walk.is_closed(corners)) check_vertex(corners, topology);
  }
  return topology;
}

}  // namespace

Topology measure_topology(const Mesh& mesh, const Context& context) {
  std::vector<Topology> parts(chunks_of(mesh.layers(), kLayersPerPart));
  const auto check = [&](std::size_t first, std::size_t end) {
    parts[first / kLayersPerPart] = check_layers(mesh, first, end);
  };
  for_chunks(context, mesh.layers(), check, kLayersPerPart);
  Topology whole;
  for (const Topology& part : parts) {
    whole.boundary_edges += part.boundary_edges;
    whole.manifold = whole.manifold && part.manifold;
    whole.oriented = whole.oriented && part.oriented;
  }
  whole.components = count_components(mesh, context);
  whole.euler = euler_of(mesh, whole.boundary_edges);
  return whole;
}

std::int64_t euler_of(const Mesh& mesh, std::uint64_t boundary_edges) {
  const std::uint64_t edges = (3 * mesh.triangles.size() + boundary_edges) / 2;
  return static_cast<std::int64_t>(mesh.positions.size()) - static_cast<std::int64_t>(edges) +
         static_cast<std::int64_t>(mesh.triangles.size());
}

}  // namespace isomesh::mesh
