#include "server/mesh/topology.h"

#include <algorithm>
#include <array>
#include <span>
#include <vector>

#include "server/mesh/components.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh {
namespace {

// Larger slabs look at fewer layers twice, smaller ones keep more of their lists in the cache.
constexpr std::size_t kLayersPerSlab = 4;

// What a triangle looks like from one of its corners: it runs on to `next` and comes from
// `previous`.
struct Corner {
  std::uint32_t next;
  std::uint32_t previous;
};

// The corners of every vertex of a run of layers, which only triangles of the same layers and of
// the one below can name; those of vertex v are [ends[v - 1], ends[v]).
class CornerLists {
 public:
  CornerLists(const Mesh& mesh, std::size_t first_layer, std::size_t end_layer)
      : begin_(mesh.layer_vertices[first_layer]),
        size_(mesh.layer_vertices[end_layer] - begin_),
        ends_(size_ + 1, 0) {
    const auto triangles = mesh.triangles_of(first_layer == 0 ? 0 : first_layer - 1, end_layer);
    // Shifted by one: while the lists are filled, an end is where its list goes on.
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

// Walks around vertices whose corners follow each other in one closed fan, as nearly all do.
class FanWalk {
 public:
  // True when the corners are one closed fan in which every neighbour is next once and previous
  // once. False also where that was not to be found out at once.
  bool is_closed(std::span<const Corner> corners) {
    const std::size_t count = corners.size();
    if (count < 3 || count > kMostCorners) return false;
    for (std::size_t i = 0; i < count; ++i) {
      by_previous_[slot(corners[i].previous)] = static_cast<std::uint8_t>(i);
    }
    // Which corner follows each, found for all independently of each other: four bits a corner.
    std::uint64_t following = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t found = by_previous_[slot(corners[i].next)];
      if (found >= count || corners[found].previous != corners[i].next) return false;
      following |= std::uint64_t{found} << (kBits * i);
    }
    // A walk that first comes back to where it began after as many steps as there are corners has
    // been at each once.
    std::size_t at = 0;
    for (std::size_t step = 1; step < count; ++step) {
      at = following >> (kBits * at) & (kMostCorners - 1);
      if (at == 0) return false;
    }
    return (following >> (kBits * at) & (kMostCorners - 1)) == 0;
  }

 private:
  static constexpr std::size_t kBits = 4;
  static constexpr std::size_t kMostCorners = 1 << kBits;
  static constexpr std::size_t kSlots = 4096;

  static std::size_t slot(std::uint32_t vertex) { return vertex % kSlots; }

  // A corner for some neighbours by what their numbers leave; what it says is always checked.
  std::array<std::uint8_t, kSlots> by_previous_ = {};
};

// How often a neighbour is next and previous, and the smallest neighbour that its fan connects it
// with.
struct Neighbor {
  std::uint32_t vertex;
  std::uint32_t next = 0;
  std::uint32_t previous = 0;
  std::size_t fan = 0;
};

// The definitions, one by one.
void check_vertex(std::span<const Corner> corners, Topology& topology) {
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
    if (next == previous) topology.manifold = false;  // the triangle names a vertex twice
    const std::size_t joined = std::min(next->fan, previous->fan);
    const std::size_t other = std::max(next->fan, previous->fan);
    for (Neighbor& neighbor : neighbors) {
      if (neighbor.fan == other) neighbor.fan = joined;
    }
  }
  for (const Neighbor& neighbor : neighbors) {
    if (neighbor.next + neighbor.previous > 2 || neighbor.fan != 0) topology.manifold = false;
    if (neighbor.next > 1 || neighbor.previous > 1) topology.oriented = false;
    // From the end that the edge runs from; the other end does not count it.
    if (neighbor.next == 1 && neighbor.previous == 0) ++topology.boundary_edges;
  }
}

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
  const std::size_t slabs = (mesh.layers() + kLayersPerSlab - 1) / kLayersPerSlab;
  std::vector<Topology> parts(slabs);
  parallel_for(context, slabs, [&](std::size_t slab) {
    const std::size_t first = slab * kLayersPerSlab;
    parts[slab] = check_layers(mesh, first, std::min(mesh.layers(), first + kLayersPerSlab));
  });
  Topology whole;
  for (const Topology& part : parts) {
    whole.boundary_edges += part.boundary_edges;
    whole.manifold = whole.manifold && part.manifold;
    whole.oriented = whole.oriented && part.oriented;
  }
  whole.components = count_components(mesh, context);
  const std::uint64_t edges = (3 * mesh.triangles.size() + whole.boundary_edges) / 2;
  whole.euler = static_cast<std::int64_t>(mesh.positions.size()) -
                static_cast<std::int64_t>(edges) + static_cast<std::int64_t>(mesh.triangles.size());
  return whole;
}

}  // namespace isomesh::mesh
