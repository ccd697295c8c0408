// Edges of a block collapse, those of the least quadric first; private to this folder.
//
// M. Garland, P. S. Heckbert, "Surface simplification using quadric error metrics", SIGGRAPH 1997.
// Quadrics only decide the order.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "server/mesh/collapse/corners.h"
#include "server/mesh/collapse/quadric.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh::collapse {

// `Own` derives from it and decides which edges may go:
//   kBuckets            of costs; edges of more stay
//   kTries              edges of a vertex that are tried
//   kLeastNeighbours    of vertices that take part, and kMostNeighbours of those that go
//   kInOrder            an edge waits for its bucket even if a better one of its vertex may not go
//   kMovesTheOther      the end that is left need not stay in its place
//   int bucket_of(float cost, float weight) const
//   bool collapse(std::uint32_t a, std::size_t k, int bucket)  calls finish() if a may become
//                       ring()[k], with the link condition fulfilled
template <class Own>
class Collapser {
 protected:
  // The data for computing costs, in one cache line.
  struct alignas(64) Node {
    Quadric quadric;  // about the place
    Vecf place;       // from the block's first vertex
    bool stays = false;
  };

  Collapser(std::span<const Triangle> triangles, std::size_t vertices)
      : corners_(triangles, vertices, Own::kLeastNeighbours, Own::kMostNeighbours),
        queue_(Own::kBuckets) {
    nodes_.reserve(vertices);
  }

  bool stays(std::uint32_t a) const { return nodes_[a].stays; }
  Vecf way(std::uint32_t a, std::uint32_t b) const { return nodes_[b].place - nodes_[a].place; }

  // Once there are all nodes.
  void make_quadrics(std::span<const Triangle> triangles) {
    for (const auto& [a, b, c] : triangles) {
      const Quadric plane = Quadric::of_plane(cross(way(a, b), way(a, c)));
      for (const std::uint32_t x : {a, b, c}) nodes_[x].quadric = nodes_[x].quadric + plane;
    }
    bucket_.assign(nodes_.size(), -1);
  }

  // Until `least` triangles are left or no edge may go. `first` flags the vertices to begin with.
  void run(std::size_t least, std::span<const std::uint8_t> first) {
    for (std::uint32_t a = 0; a < nodes_.size(); ++a) {
      if (first[a] != 0) push(a, 0);
    }
    for (int bucket = 0; bucket < Own::kBuckets; ++bucket) {
      for (std::size_t k = 0; k < queue_[bucket].size() && corners_.left() > least; ++k) {
        const std::uint32_t a = queue_[bucket][k];
        if (bucket_[a] != bucket) continue;
        bucket_[a] = -1;
        try_vertex(a, bucket);
      }
      queue_[bucket].clear();
    }
  }

  // Gives a's triangles to ring()[k]; `quadric` is about a's place, `p` the new one of ring()[k].
  void finish(std::uint32_t a, std::size_t k, int bucket, const Quadric& quadric, Vecf p) {
    const std::uint32_t b = corners_.ring()[k];
    nodes_[b].quadric = quadric.about(p - nodes_[a].place);
    nodes_[b].place = p;
    corners_.collapse(k);
    bucket_[a] = -1;
    bucket_[b] = -1;
    push(b, bucket);
    for (const std::uint32_t r : corners_.ring()) {
      if (r != b) push_edge(r, b, bucket);
    }
  }

  Corners corners_;
  std::vector<Node> nodes_;

 private:
  // At least that of both at one of their places.
  float cost(std::uint32_t a, std::uint32_t b) const {
    const Vecf d = way(a, b);
    // Rounding makes c negative where there is no cost.
    const float at_b = std::max(0.0F, nodes_[a].quadric.at(d) + nodes_[b].quadric.c);
    if (!Own::kMovesTheOther || stays(b)) return at_b;
    const float at_a = nodes_[b].quadric.at(d * -1.0F) + nodes_[a].quadric.c;
    return std::min(at_b, std::max(0.0F, at_a));
  }

  int bucket_of(std::uint32_t a, float cost) const {
    return static_cast<const Own*>(this)->bucket_of(cost, nodes_[a].quadric.weight);
  }

  void put(std::uint32_t a, int bucket) {
    if (bucket >= Own::kBuckets || (bucket_[a] >= 0 && bucket_[a] <= bucket)) return;
    bucket_[a] = bucket;
    queue_[bucket].push_back(a);
  }

  void push(std::uint32_t a, int at_least) {
    if (stays(a) || corners_.is_gone(a)) return;
    float best = 1e30F;
    corners_.visit_neighbours(a, [&](std::uint32_t b) { best = std::min(best, cost(a, b)); });
    put(a, std::max(at_least, bucket_of(a, best)));
  }

  // Like push(), if only the edge to `b` is new.
  void push_edge(std::uint32_t a, std::uint32_t b, int at_least) {
    if (stays(a) || corners_.is_gone(a)) return;
    put(a, std::max(at_least, bucket_of(a, cost(a, b))));
  }

  void try_vertex(std::uint32_t a, int bucket) {
    if (!corners_.walk_around(a)) return;
    const std::vector<std::uint32_t>& ring = corners_.ring();
    std::array<std::pair<float, std::size_t>, Own::kMostNeighbours> order;
    for (std::size_t k = 0; k < ring.size(); ++k) order[k] = {cost(a, ring[k]), k};
    for (std::size_t k = 0; k < std::min(Own::kTries, ring.size()); ++k) {
      const auto least = std::min_element(order.begin() + k, order.begin() + ring.size());
      std::swap(order[k], *least);
      const int its = bucket_of(a, order[k].first);
      if (its >= Own::kBuckets) return;
      if (Own::kInOrder && its > bucket) return put(a, its);
      const std::size_t to = order[k].second;
      if (corners_.keeps_topology(to) && static_cast<Own*>(this)->collapse(a, to, bucket)) return;
    }
  }

  std::vector<int> bucket_;  // of each vertex that waits, or -1
  std::vector<std::vector<std::uint32_t>> queue_;
};

}  // namespace isomesh::mesh::collapse
