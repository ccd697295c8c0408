#include "server/mesh/collapse/edge_collapses.h"

#include <algorithm>
#include <cmath>

namespace isomesh::mesh {
namespace {

// No triangle is turned farther than this by one collapse.
constexpr double kLeastCosine = 0.25;

}  // namespace

EdgeCollapses::EdgeCollapses(const Mesh& mesh, std::span<const Triangle> triangles)
    : mesh_(mesh, triangles),
      is_gone_(mesh_.triangles.size(), false),
      around_(mesh_.origin.size()) {
  for (std::uint32_t t = 0; t < mesh_.triangles.size(); ++t) {
    for (const std::uint32_t vertex : mesh_.triangles[t]) around_[vertex].push_back(t);
  }
}

std::pair<Numbers, Numbers> EdgeCollapses::split_star(std::uint32_t v, std::uint32_t into) const {
  std::pair<Numbers, Numbers> star;
  for (const std::uint32_t t : around_[v]) {
    (has(mesh_.triangles[t], into) ? star.first : star.second).push_back(t);
  }
  return star;
}

std::uint32_t EdgeCollapses::third(std::uint32_t triangle, std::uint32_t a, std::uint32_t b) const {
  const auto& corners = mesh_.triangles[triangle];
  return *std::ranges::find_if(corners, [&](std::uint32_t c) { return c != a && c != b; });
}

bool EdgeCollapses::are_neighbours(std::uint32_t a, std::uint32_t b) const {
  if (around_[b].size() < around_[a].size()) std::swap(a, b);
  return std::ranges::any_of(around_[a],
                             [&](std::uint32_t t) { return has(mesh_.triangles[t], b); });
}

Numbers EdgeCollapses::neighbours(std::uint32_t v) const {
  Numbers found;
  for (const std::uint32_t t : around_[v]) {
    for (const std::uint32_t vertex : mesh_.triangles[t]) {
      if (vertex != v) found.push_back(vertex);
    }
  }
  std::ranges::sort(found);
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

bool EdgeCollapses::links_meet_at_edge(std::uint32_t v, std::uint32_t into,
                                       const Numbers& gone) const {
  Numbers apexes;
  for (const std::uint32_t t : gone) apexes.push_back(third(t, v, into));
  std::ranges::sort(apexes);
  if (std::ranges::adjacent_find(apexes) != apexes.end()) return false;
  const auto is_beside_both = [&](std::uint32_t vertex) {
    return vertex != into && !std::ranges::binary_search(apexes, vertex) &&
           are_neighbours(vertex, into);
  };
  if (std::ranges::any_of(neighbours(v), is_beside_both)) return false;
  return std::ranges::none_of(around_[v], [&](std::uint32_t t) {
    return std::ranges::all_of(mesh_.triangles[t], [&](std::uint32_t vertex) {
      return vertex == v || std::ranges::binary_search(apexes, vertex);
    });
  });
}

Triangle EdgeCollapses::moved(std::uint32_t triangle, std::uint32_t v, std::uint32_t into) const {
  Triangle corners = mesh_.triangles[triangle];
  std::ranges::replace(corners, v, into);
  return corners;
}

bool EdgeCollapses::stays_upright(std::uint32_t v, std::uint32_t into, const Numbers& kept) const {
  return std::ranges::all_of(kept, [&](std::uint32_t t) {
    const Point before = mesh_.normal(mesh_.triangles[t]);
    const Point after = mesh_.normal(moved(t, v, into));
    const double lengths = std::sqrt(dot(before, before) * dot(after, after));
    return lengths > 0 && dot(before, after) > kLeastCosine * lengths;
  });
}

void EdgeCollapses::collapse_edge(std::uint32_t v, std::uint32_t into, const Numbers& gone,
                                  const Numbers& kept) {
  for (const std::uint32_t t : gone) {
    is_gone_[t] = true;
    for (const std::uint32_t vertex : mesh_.triangles[t]) std::erase(around_[vertex], t);
  }
  for (const std::uint32_t t : kept) mesh_.triangles[t] = moved(t, v, into);
  around_[into].insert(around_[into].end(), kept.begin(), kept.end());
  around_[v].clear();
}

}  // namespace isomesh::mesh
