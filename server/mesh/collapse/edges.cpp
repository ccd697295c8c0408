#include "server/mesh/collapse/edges.h"

#include <algorithm>
#include <atomic>
#include <utility>

#include "server/mesh/parallel.h"

namespace isomesh::mesh::collapse {
namespace {

// Calls visit(lesser vertex, greater vertex) for the edges of all triangles.
template <class Visit>
void visit_edges(std::span<const Triangle> triangles, const Context& context, Visit visit) {
  for_each(context, triangles.size(), [&](std::size_t t) {
    const auto& [a, b, c] = triangles[t];
    visit(std::min(a, b), std::max(a, b));
    visit(std::min(b, c), std::max(b, c));
    visit(std::min(c, a), std::max(c, a));
  });
}

}  // namespace

Edges edges_of(std::size_t vertices, std::span<const Triangle> triangles, const Context& context) {
  // The order in which threads find a vertex's edges is forgotten below.
  std::vector<std::atomic<std::uint32_t>> next(vertices);
  visit_edges(triangles, context, [&](std::uint32_t a, std::uint32_t) {
    next[a].fetch_add(1, std::memory_order_relaxed);
  });
  Edges edges;
  edges.begin.resize(vertices);
  edges.end.resize(vertices);
  std::size_t sum = 0;
  for (std::size_t a = 0; a < vertices; ++a) {
    edges.begin[a] = sum;
    sum += next[a].exchange(0, std::memory_order_relaxed);
    edges.end[a] = sum;
  }
  edges.ends.resize(sum);
  visit_edges(triangles, context, [&](std::uint32_t a, std::uint32_t b) {
    edges.ends[edges.begin[a] + next[a].fetch_add(1, std::memory_order_relaxed)].vertex = b;
  });
  for_each(context, vertices, [&](std::size_t a) {
    const auto first = edges.ends.begin() + static_cast<std::ptrdiff_t>(edges.begin[a]);
    const auto last = edges.ends.begin() + static_cast<std::ptrdiff_t>(edges.end[a]);
    std::ranges::sort(first, last, {}, &Edges::End::vertex);
    auto to = first;
    for (auto same = first; same != last;) {
      const std::uint32_t vertex = same->vertex;
      bool is_odd = false;
      for (; same != last && same->vertex == vertex; ++same) is_odd = !is_odd;
      *to++ = {vertex, is_odd};
    }
    edges.end[a] = static_cast<std::size_t>(to - edges.ends.begin());
  });
  return edges;
}

std::vector<Edge> Edges::odd() const {
  std::vector<Edge> odd;
  for (std::uint32_t a = 0; a < begin.size(); ++a) {
    for (const End& end_of_a : of(a)) {
      if (end_of_a.is_odd) odd.push_back({a, end_of_a.vertex});
    }
  }
  return odd;
}

}  // namespace isomesh::mesh::collapse
