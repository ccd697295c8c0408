#include "server/mesh/collapse/simplify_lines.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <queue>
#include <utility>
#include <vector>

#include "server/mesh/measure/point_triangle.h"
#include "server/mesh/points.h"

namespace isomesh::mesh::collapse {
namespace {

// The first request, as a share of the bound: the walls' own distance adds to that of lines.
constexpr double kLineError = 0.5;

constexpr double kLeastCosine = 0.25;  // between a triangle's normals before and after

using mesh::dot;
using Numbers = std::vector<std::uint32_t>;

bool has(std::span<const std::uint32_t> numbers, std::uint32_t number) {
  return std::ranges::find(numbers, number) != numbers.end();
}

class LineSimplifier {
 public:
  LineSimplifier(const SimplifySurroundings& around, std::span<const WallSides> sides, Patch& patch)
      : around_(around),
        sides_(sides),
        patch_(patch),
        squared_bound_(std::pow(kLineError * around.max_error_mm, 2)),
        is_gone_(patch.triangles.size(), false),
        around_vertex_(patch.names.size()),
        on_line_beside_(patch.names.size()),
        is_at_end_(patch.names.size(), false),
        version_(patch.names.size(), 0) {
    for (std::uint32_t t = 0; t < patch.triangles.size(); ++t) {
      for (const std::uint32_t vertex : patch.triangles[t]) around_vertex_[vertex].push_back(t);
    }
    find_lines();
    for (std::size_t v = 0; v < patch.names.size(); ++v) {
      is_free_.push_back(patch.stays[v] == 0 && around.mesh.is_on_line(patch.names[v]) &&
                         !is_at_end_[v]);
    }
  }

  void run(double share) {
    std::size_t left = 0;
    for (std::uint32_t v = 0; v < is_free_.size(); ++v) {
      if (!is_within_line(v)) continue;
      ++left;
      put_in_queue(v);
    }
    const auto wanted = static_cast<std::size_t>(std::sqrt(share) * static_cast<double>(left));
    while (!queue_.empty() && left > wanted) {
      const Candidate next = queue_.top();
      queue_.pop();
      if (next.version != version_[next.vertex] || !collapse(next.vertex)) continue;
      --left;
    }
    take();
  }

 private:
  // A vertex, and how far what its line stands for would be from it without.
  struct Candidate {
    double squared_mm;
    std::uint32_t vertex;
    std::uint32_t version;

    bool operator>(const Candidate& other) const {
      return std::pair(squared_mm, vertex) > std::pair(other.squared_mm, other.vertex);
    }
  };

  using Edge = std::pair<std::uint32_t, std::uint32_t>;
  static Edge edge(std::uint32_t a, std::uint32_t b) { return std::minmax(a, b); }

  // Finds the edges of junction curves and of the surface's ends: all that do not have exactly two
  // triangles of one wall.
  void find_lines() {
    std::vector<std::pair<Edge, std::uint32_t>> edges;
    edges.reserve(3 * patch_.triangles.size());
    for (std::uint32_t t = 0; t < patch_.triangles.size(); ++t) {
      const auto& [a, b, c] = patch_.triangles[t];
      for (const Edge& side : {edge(a, b), edge(b, c), edge(c, a)}) edges.emplace_back(side, t);
    }
    std::ranges::sort(edges);
    for (std::size_t begin = 0; begin < edges.size();) {
      std::size_t end = begin;
      while (end < edges.size() && edges[end].first == edges[begin].first) ++end;
      const auto [a, b] = edges[begin].first;
      const bool is_within_wall =
          end - begin == 2 && sides_of(edges[begin].second) == sides_of(edges[begin + 1].second);
      if (!is_within_wall) {
        on_line_beside_[a].push_back(b);
        on_line_beside_[b].push_back(a);
      }
      if (end - begin == 1) is_at_end_[a] = is_at_end_[b] = true;
      begin = end;
    }
  }

  // True if the vertex is free and its triangles form only fans between its two neighbours on the
  // junction curve.
  bool is_within_line(std::uint32_t v) const {
    if (!is_free_[v] || on_line_beside_[v].size() != 2) return false;
    const std::uint32_t from = on_line_beside_[v][0];
    const std::uint32_t to = on_line_beside_[v][1];
    std::size_t seen = 0;
    for (const std::uint32_t first : around_vertex_[v]) {
      if (!has(patch_.triangles[first], from)) continue;
      std::uint32_t at = from;
      std::uint32_t triangle = first;
      for (std::size_t steps = 0; steps <= around_vertex_[v].size(); ++steps) {
        ++seen;
        at = third(triangle, v, at);
        if (at == to) break;
        const auto next = std::ranges::find_if(around_vertex_[v], [&](std::uint32_t t) {
          return t != triangle && has(patch_.triangles[t], at);
        });
        if (at == from || next == around_vertex_[v].end()) return false;
        triangle = *next;
      }
    }
    return seen == around_vertex_[v].size();
  }

  void put_in_queue(std::uint32_t v) {
    const Edge beside = edge(on_line_beside_[v][0], on_line_beside_[v][1]);
    const mesh::Corners segment = {at(beside.first), at(beside.second), at(beside.second)};
    double farthest = squared_distance(at(v), segment);
    for (const std::uint32_t end : on_line_beside_[v]) {
      const auto passed = passed_.find(edge(v, end));
      if (passed == passed_.end()) continue;
      for (const std::uint32_t vertex : passed->second) {
        farthest = std::max(farthest, squared_distance(at(vertex), segment));
      }
    }
    if (farthest <= squared_bound_) queue_.push({farthest, v, version_[v]});
  }

  // Into the nearer of its neighbours on the line, or the other one.
  bool collapse(std::uint32_t v) {
    std::array<std::uint32_t, 2> ends = {on_line_beside_[v][0], on_line_beside_[v][1]};
    const auto length = [&](std::uint32_t end) {
      const Point along = minus(at(end), at(v));
      return std::pair(dot(along, along), end);
    };
    if (length(ends[1]) < length(ends[0])) std::swap(ends[0], ends[1]);
    return collapse(v, ends[0], ends[1]) || collapse(v, ends[1], ends[0]);
  }

  bool collapse(std::uint32_t v, std::uint32_t into, std::uint32_t beyond) {
    const auto [gone, kept] = split_star(v, into);
    const bool is_edge = has(on_line_beside_[into], beyond) || may_be_edge_elsewhere(into, beyond);
    if (is_edge || !links_meet_at_edge(v, into, gone)) return false;
    if (!stays_upright(v, into, kept)) return false;
    if (around_.points != nullptr && !stays_near(v, into, gone, kept)) return false;
    if (around_.history != nullptr) {
      around_.history->add({patch_.names[v], patch_.names[into], around_.step + collapses_});
    }
    move(v, into, beyond, gone, kept);
    return true;
  }

  bool stays_near(std::uint32_t v, std::uint32_t into, const Numbers& gone, const Numbers& kept) {
    Numbers star;
    std::vector<KeptPoints::Shape> shapes;
    for (const std::uint32_t t : gone) star.push_back(patch_.numbers[t]);
    for (const std::uint32_t t : kept) {
      star.push_back(patch_.numbers[t]);
      Triangle corners = moved(t, v, into);
      std::rotate(corners.begin(), std::ranges::find(corners, into), corners.end());
      shapes.push_back({star.back(), corners_of(corners), true});
    }
    return around_.points->replace(star, shapes);
  }

  // The triangles around a vertex that a collapse takes away, and those that it leaves.
  std::pair<Numbers, Numbers> split_star(std::uint32_t v, std::uint32_t into) const {
    std::pair<Numbers, Numbers> star;
    for (const std::uint32_t t : around_vertex_[v]) {
      (has(patch_.triangles[t], into) ? star.first : star.second).push_back(t);
    }
    return star;
  }

  std::uint32_t third(std::uint32_t triangle, std::uint32_t a, std::uint32_t b) const {
    const auto& corners = patch_.triangles[triangle];
    return *std::ranges::find_if(corners, [&](std::uint32_t c) { return c != a && c != b; });
  }

  bool are_neighbours(std::uint32_t a, std::uint32_t b) const {
    if (around_vertex_[b].size() < around_vertex_[a].size()) std::swap(a, b);
    return std::ranges::any_of(around_vertex_[a],
                               [&](std::uint32_t t) { return has(patch_.triangles[t], b); });
  }

  // Other patches may have the edge, or make it at the same time.
  bool may_be_edge_elsewhere(std::uint32_t a, std::uint32_t b) const {
    return (patch_.stays[a] & patch_.stays[b] & kIsElsewhere) != 0;
  }

  Numbers neighbours(std::uint32_t v) const {
    Numbers found;
    for (const std::uint32_t t : around_vertex_[v]) {
      for (const std::uint32_t vertex : patch_.triangles[t]) {
        if (vertex != v) found.push_back(vertex);
      }
    }
    std::ranges::sort(found);
    found.erase(std::unique(found.begin(), found.end()), found.end());
    return found;
  }

  bool links_meet_at_edge(std::uint32_t v, std::uint32_t into, const Numbers& gone) const {
    Numbers apexes;
    for (const std::uint32_t t : gone) apexes.push_back(third(t, v, into));
    std::ranges::sort(apexes);
    if (std::ranges::adjacent_find(apexes) != apexes.end()) return false;
    const auto is_beside_both = [&](std::uint32_t vertex) {
      return vertex != into && !std::ranges::binary_search(apexes, vertex) &&
             (are_neighbours(vertex, into) || may_be_edge_elsewhere(vertex, into));
    };
    if (std::ranges::any_of(neighbours(v), is_beside_both)) return false;
    return std::ranges::none_of(around_vertex_[v], [&](std::uint32_t t) {
      return std::ranges::all_of(patch_.triangles[t], [&](std::uint32_t vertex) {
        return vertex == v || std::ranges::binary_search(apexes, vertex);
      });
    });
  }

  Triangle moved(std::uint32_t triangle, std::uint32_t v, std::uint32_t into) const {
    Triangle corners = patch_.triangles[triangle];
    std::ranges::replace(corners, v, into);
    return corners;
  }

  bool stays_upright(std::uint32_t v, std::uint32_t into, const Numbers& kept) const {
    return std::ranges::all_of(kept, [&](std::uint32_t t) {
      const Point before = normal(patch_.triangles[t]);
      const Point after = normal(moved(t, v, into));
      const double lengths = std::sqrt(dot(before, before) * dot(after, after));
      return lengths > 0 && dot(before, after) > kLeastCosine * lengths;
    });
  }

  void move(std::uint32_t v, std::uint32_t into, std::uint32_t beyond, const Numbers& gone,
            const Numbers& kept) {
    ++collapses_;
    for (const std::uint32_t t : gone) {
      is_gone_[t] = true;
      for (const std::uint32_t vertex : patch_.triangles[t]) std::erase(around_vertex_[vertex], t);
    }
    for (const std::uint32_t t : kept) patch_.triangles[t] = moved(t, v, into);
    around_vertex_[into].insert(around_vertex_[into].end(), kept.begin(), kept.end());
    around_vertex_[v].clear();
    Numbers& passed = passed_[edge(into, beyond)];
    for (const std::uint32_t end : {into, beyond}) {
      const auto before = passed_.find(edge(v, end));
      if (before == passed_.end()) continue;
      passed.insert(passed.end(), before->second.begin(), before->second.end());
      passed_.erase(before);
    }
    passed.push_back(v);
    std::ranges::replace(on_line_beside_[into], v, beyond);
    std::ranges::replace(on_line_beside_[beyond], v, into);
    is_free_[v] = false;
    ++version_[v];
    for (const std::uint32_t end : {into, beyond}) {
      ++version_[end];
      if (is_within_line(end)) put_in_queue(end);
    }
  }

  // Leaves what is left in the patch.
  void take() {
    std::size_t count = 0;
    for (std::uint32_t t = 0; t < patch_.triangles.size(); ++t) {
      if (is_gone_[t]) continue;
      patch_.triangles[count] = patch_.triangles[t];
      patch_.numbers[count] = patch_.numbers[t];
      ++count;
    }
    patch_.triangles.resize(count);
    patch_.numbers.resize(count);
  }

  const WallSides& sides_of(std::uint32_t t) const { return sides_[patch_.numbers[t]]; }
  Point at(std::uint32_t v) const { return to_point(around_.mesh.positions[patch_.names[v]]); }
  mesh::Corners corners_of(const Triangle& triangle) const {
    return {at(triangle[0]), at(triangle[1]), at(triangle[2])};
  }
  Point normal(const Triangle& triangle) const {
    return normal_of(at(triangle[0]), at(triangle[1]), at(triangle[2]));
  }

  const SimplifySurroundings& around_;
  const std::span<const WallSides> sides_;
  Patch& patch_;
  const double squared_bound_;
  std::vector<bool> is_gone_;            // of triangles
  std::vector<Numbers> around_vertex_;   // triangles of each vertex
  std::vector<Numbers> on_line_beside_;  // of each vertex its neighbours along lines
  std::vector<bool> is_at_end_;          // whether a surface ends at the vertex
  std::vector<bool> is_free_;
  std::uint32_t collapses_ = 0;
  std::map<Edge, Numbers> passed_;      // vertices that an edge of a line stands for
  std::vector<std::uint32_t> version_;  // of a vertex; a candidate of another one is out of date
  std::priority_queue<Candidate, std::vector<Candidate>, std::greater<>> queue_;
};

}  // namespace

void simplify_lines(const SimplifySurroundings& around, std::span<const WallSides> sides,
                    double share, Patch& patch) {
  LineSimplifier(around, sides, patch).run(share);
}

}  // namespace isomesh::mesh::collapse
