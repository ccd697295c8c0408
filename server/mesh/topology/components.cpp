#include "server/mesh/topology/components.h"

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>
#include <span>
#include <vector>

#include "server/mesh/parallel.h"
#include "server/mesh/points.h"

namespace isomesh::mesh {
namespace {

constexpr std::size_t kLayersPerSlab = 16;

// Disjoint sets of vertices as a forest: every vertex points to a smaller one of its set, the
// smallest to itself. Threads may work at the same time on vertices that have no set in common.
class Forest {
 public:
  // The caller owns the memory: one number a vertex.
  explicit Forest(std::span<std::uint32_t> parents) : parents_(parents) {}

  // Makes each of the vertices [begin, end) a set of its own.
  void begin_sets(std::uint64_t begin, std::uint64_t end) {
    const auto sets = parents_.subspan(begin, end - begin);
    std::iota(sets.begin(), sets.end(), static_cast<std::uint32_t>(begin));
  }

  // Joins the corners of each triangle. Returns how many sets disappear.
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

  std::span<std::uint32_t> parents_;
};

// Makes `parents` the forest of the mesh's components. Returns their number.
std::uint64_t join_vertices(const Mesh& mesh, const Context& context,
                            std::span<std::uint32_t> parents) {
  Forest forest(parents);
  const std::size_t layers = mesh.layers();
  // Triangles within a slab come first, slabs in parallel; triangles between slabs follow.
  std::vector<std::uint64_t> joined(chunks_of(layers, kLayersPerSlab));
  const auto join_slab = [&](std::size_t begin, std::size_t end) {
    forest.begin_sets(mesh.layer_vertices[begin], mesh.layer_vertices[end]);
    joined[begin / kLayersPerSlab] =
        forest.join(mesh.triangles_of(begin, end == layers ? end : end - 1));
  };
  for_chunks(context, layers, join_slab, kLayersPerSlab);
  std::uint64_t components = parents.size();
  for (std::size_t slab = 0; slab < joined.size(); ++slab) {
    const std::size_t end = (slab + 1) * kLayersPerSlab;
    if (end < layers) joined[slab] += forest.join(mesh.triangles_of(end - 1, end));
    components -= joined[slab];
  }
  return components;
}

// The vertex nearest to each place, of several the first; none if there are no vertices.
std::vector<std::uint32_t> nearest_vertices(std::span<const std::array<double, 3>> places,
                                            const Context& context, const Mesh& mesh) {
  constexpr std::size_t kPerTask = 1 << 16;
  const std::size_t count = mesh.positions.size();
  if (places.empty() || count == 0) return {};
  struct Nearest {
    double squared_mm = std::numeric_limits<double>::infinity();
    std::uint32_t vertex = 0;
  };
  const std::size_t tasks = chunks_of(count, kPerTask);
  std::vector<Nearest> found(tasks * places.size());
  const auto find = [&](std::size_t begin, std::size_t end) {
    for (std::size_t n = 0; n < places.size(); ++n) {
      Nearest& nearest = found[begin / kPerTask * places.size() + n];
      for (std::size_t v = begin; v < end; ++v) {
        const Point way = minus(to_point(mesh.positions[v]), places[n]);
        const double squared_mm = dot(way, way);
        if (squared_mm < nearest.squared_mm) nearest = {squared_mm, static_cast<std::uint32_t>(v)};
      }
    }
  };
  for_chunks({context.stop, nullptr}, count, find, kPerTask);
  std::vector<std::uint32_t> vertices;
  for (std::size_t n = 0; n < places.size(); ++n) {
    Nearest nearest;
    for (std::size_t task = 0; task < tasks; ++task) {
      const Nearest& here = found[task * places.size() + n];
      if (here.squared_mm < nearest.squared_mm) nearest = here;
    }
    vertices.push_back(nearest.vertex);
  }
  return vertices;
}

// The candidates that stay.
std::vector<bool> kept_by(const ComponentFilter& filter, const std::vector<bool>& is_candidate,
                          const std::vector<std::uint64_t>& triangles) {
  std::vector<std::uint32_t> order(triangles.size());
  std::iota(order.begin(), order.end(), 0U);
  std::erase_if(order, [&](std::uint32_t n) {
    return !is_candidate[n] || triangles[n] < filter.min_triangles.value_or(0);
  });
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

// Clears the flags of those that do not stay.
void clear_kept(const std::vector<bool>& kept, const Buffer<std::uint32_t>& of_vertex,
                std::vector<std::uint64_t>& flags) {
  if (flags.empty()) {
    flags.assign((of_vertex.size() + kFlagBits - 1) / kFlagBits, ~std::uint64_t{0});
    if (of_vertex.size() % kFlagBits != 0) {
      flags.back() = (std::uint64_t{1} << (of_vertex.size() % kFlagBits)) - 1;
    }
  }
  std::size_t v = 0;
  for (std::uint64_t& word : flags) {
    for (std::uint64_t left = word; left != 0; left &= left - 1, ++v) {
      if (!kept[of_vertex[v]]) word &= ~(left & (0 - left));
    }
  }
}

// Moves the vertices that stay to the front; `of_vertex` becomes the new number of each.
void keep_vertices(const std::vector<bool>& kept, Buffer<std::uint32_t>& of_vertex, Mesh& mesh) {
  clear_kept(kept, of_vertex, mesh.kept);
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

std::uint64_t count_components(const Mesh& mesh, const Context& context) {
  Buffer<std::uint32_t> parents;
  parents.resize_for_overwrite(mesh.positions.size());
  return join_vertices(mesh, context, parents.span());
}

void find_components(const Mesh& mesh, const Context& context, Components& components) {
  components.of_vertex.resize_for_overwrite(mesh.positions.size());
  const std::span<std::uint32_t> numbers = components.of_vertex.span();
  join_vertices(mesh, context, numbers);
  // A parent is smaller, so it already has its component's number.
  components.count = 0;
  for (std::uint32_t v = 0; v < numbers.size(); ++v) {
    numbers[v] = numbers[v] == v ? components.count++ : numbers[numbers[v]];
  }
}

std::vector<std::uint64_t> triangles_of(const Components& components, const Mesh& mesh) {
  std::vector<std::uint64_t> triangles(components.count, 0);
  for (const Triangle& triangle : mesh.triangles) ++triangles[components.of_vertex[triangle[0]]];
  return triangles;
}

Dropped leave_out(const std::vector<bool>& kept, const std::vector<std::uint64_t>& triangles,
                  Components& components, Mesh& mesh) {
  Dropped dropped;
  for (std::size_t n = 0; n < kept.size(); ++n) {
    if (kept[n]) continue;
    ++dropped.components;
    dropped.triangles += triangles[n];
  }
  if (dropped.components == 0) return dropped;
  mesh.reach = {};
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

Dropped keep_components(const ComponentFilter& filter, const Context& context, Mesh& mesh) {
  Components components;
  find_components(mesh, context, components);
  const std::vector<std::uint64_t> triangles = triangles_of(components, mesh);
  std::vector<bool> is_candidate(triangles.size(), filter.nearest_to.empty());
  for (const std::uint32_t vertex : nearest_vertices(filter.nearest_to, context, mesh)) {
    is_candidate[components.of_vertex[vertex]] = true;
  }
  const std::vector<bool> kept = kept_by(filter, is_candidate, triangles);
  context.throw_if_stopped();
  return leave_out(kept, triangles, components, mesh);
}

}  // namespace isomesh::mesh
