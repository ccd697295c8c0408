#include "server/mesh/components.h"

#include <algorithm>
#include <numeric>
#include <vector>

namespace isomesh::mesh {
namespace {

constexpr std::size_t kLayersPerSlab = 16;

// Disjoint sets of vertices as a forest. Every vertex but a set's smallest points to a smaller one.
class Forest {
 public:
  explicit Forest(std::uint32_t* parents) : parents_(parents) {}

  void join(const Triangle& triangle) {
    join(triangle[0], triangle[1]);
    join(triangle[0], triangle[2]);
  }

 private:
  void join(std::uint32_t a, std::uint32_t b) {
    a = root(a);
    b = root(b);
    if (a != b) parents_[std::max(a, b)] = std::min(a, b);
  }

  std::uint32_t root(std::uint32_t vertex) {
    while (parents_[vertex] != vertex) {
      parents_[vertex] = parents_[parents_[vertex]];
      vertex = parents_[vertex];
    }
    return vertex;
  }

  std::uint32_t* parents_;
};

// Which components stay.
std::vector<bool> kept_by(const ComponentFilter& filter,
                          const std::vector<std::uint64_t>& triangles) {
  std::vector<std::uint32_t> order(triangles.size());
  std::iota(order.begin(), order.end(), 0U);
  std::erase_if(order,
                [&](std::uint32_t n) { return triangles[n] < filter.min_triangles.value_or(0); });
  if (filter.keep && order.size() > *filter.keep) {
    const auto larger = [&](std::uint32_t a, std::uint32_t b) {
      return triangles[a] != triangles[b] ? triangles[a] > triangles[b] : a < b;
    };
    std::ranges::nth_element(order, order.begin() + *filter.keep, larger);
    order.resize(*filter.keep);
  }
  std::vector<bool> kept(triangles.size(), false);
  for (const std::uint32_t n : order) kept[n] = true;
  return kept;
}

void set_flag(std::vector<std::uint64_t>& flags, std::size_t at, bool value) {
  const std::uint64_t bit = std::uint64_t{1} << (at % kFlagBits);
  flags[at / kFlagBits] = (flags[at / kFlagBits] & ~bit) | (value ? bit : 0);
}

// Moves the vertices that stay to the front; `of_vertex` becomes the new number of each.
void keep_vertices(const std::vector<bool>& kept, Buffer<std::uint32_t>& of_vertex, Mesh& mesh) {
  std::uint32_t next = 0;
  std::size_t v = 0;
  for (std::size_t layer = 0; layer < mesh.layers(); ++layer) {
    for (; v < mesh.layer_vertices[layer + 1]; ++v) {
      if (!kept[of_vertex[v]]) continue;
      of_vertex[v] = next;
      mesh.positions[next] = mesh.positions[v];
      if (!mesh.on_border.empty()) set_flag(mesh.on_border, next, mesh.is_on_border(v));
      ++next;
    }
    mesh.layer_vertices[layer + 1] = next;
  }
  mesh.positions.shrink(next);
  if (mesh.on_border.empty()) return;
  mesh.on_border.resize((next + kFlagBits - 1) / kFlagBits);
  if (next % kFlagBits != 0) {
    mesh.on_border.back() &= (std::uint64_t{1} << (next % kFlagBits)) - 1;
  }
}

}  // namespace

void find_components(const Mesh& mesh, const Context& context, Components& components) {
  const std::size_t vertices = mesh.positions.size();
  components.of_vertex.resize_for_overwrite(vertices);
  std::uint32_t* const parents = components.of_vertex.data();
  const std::size_t slabs = (mesh.layers() + kLayersPerSlab - 1) / kLayersPerSlab;
  // First what lies within a slab, slabs side by side; then the triangles between two slabs.
  std::vector<std::vector<Triangle>> between(slabs);
  parallel_for(context, slabs, [&](std::size_t slab) {
    const std::size_t first_layer = slab * kLayersPerSlab;
    const std::size_t end_layer = std::min(mesh.layers(), first_layer + kLayersPerSlab);
    const std::size_t begin = mesh.layer_vertices[first_layer];
    const std::size_t end = mesh.layer_vertices[end_layer];
    std::iota(parents + begin, parents + end, static_cast<std::uint32_t>(begin));
    Forest forest(parents);
    for (std::size_t t = mesh.layer_triangles[first_layer]; t < mesh.layer_triangles[end_layer];
         ++t) {
      const Triangle& triangle = mesh.triangles[t];
      if (std::ranges::max(triangle) < end) {
        forest.join(triangle);
      } else {
        between[slab].push_back(triangle);
      }
    }
  });
  Forest forest(parents);
  for (const auto& triangles : between) {
    for (const Triangle& triangle : triangles) forest.join(triangle);
  }
  // A parent is smaller, so it has become its component's number already.
  components.count = 0;
  for (std::uint32_t v = 0; v < vertices; ++v) {
    parents[v] = parents[v] == v ? components.count++ : parents[parents[v]];
  }
}

Dropped keep_components(const ComponentFilter& filter, const Context& context, Mesh& mesh) {
  Components components;
  find_components(mesh, context, components);
  std::vector<std::uint64_t> triangles(components.count, 0);
  for (const Triangle& triangle : mesh.triangles) ++triangles[components.of_vertex[triangle[0]]];
  const std::vector<bool> kept = kept_by(filter, triangles);
  context.throw_if_stopped();

  Dropped dropped;
  for (std::size_t n = 0; n < kept.size(); ++n) {
    if (kept[n]) continue;
    ++dropped.components;
    dropped.triangles += triangles[n];
  }
  if (dropped.components == 0) return dropped;
  std::uint64_t next = 0;
  std::uint64_t t = 0;
  const auto is_kept = [&](const Triangle& triangle) {
    return kept[components.of_vertex[triangle[0]]];
  };
  for (std::size_t layer = 0; layer < mesh.layers(); ++layer) {
    for (; t < mesh.layer_triangles[layer + 1]; ++t) {
      if (is_kept(mesh.triangles[t])) mesh.triangles[next++] = mesh.triangles[t];
    }
    mesh.layer_triangles[layer + 1] = next;
  }
  mesh.triangles.shrink(next);
  keep_vertices(kept, components.of_vertex, mesh);
  for (Triangle& triangle : mesh.triangles) {
    for (std::uint32_t& vertex : triangle) vertex = components.of_vertex[vertex];
  }
  return dropped;
}

}  // namespace isomesh::mesh
