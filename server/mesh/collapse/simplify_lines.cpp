#include "server/mesh/collapse/simplify_lines.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <queue>
#include <utility>
#include <vector>

#include "server/mesh/collapse/edge_collapses.h"
#include "server/mesh/measure/point_triangle.h"

namespace isomesh::mesh {
namespace {

class LineSimplifier : private EdgeCollapses {
 public:
  LineSimplifier(const BlockGoal& goal, std::span<const std::uint8_t> is_free, SurfaceBlock& block)
      : EdgeCollapses(goal.mesh, block.triangles),
        goal_(goal),
        block_(block),
        squared_bound_(std::pow(kWithin * goal.max_error_mm, 2)),
        squared_line_bound_(std::pow(kFirstError * goal.max_error_mm, 2)),
        points_(mesh_.triangles.size()),
        on_line_beside_(mesh_.origin.size()),
        version_(mesh_.origin.size(), 0) {
    for (std::uint32_t n = 0; n < block.homes.size(); ++n) points_[block.homes[n]].push_back(n);
    find_lines();
    is_free_.resize(mesh_.origin.size());
    for (std::size_t v = 0; v < is_free_.size(); ++v) {
      const std::uint32_t vertex = mesh_.origin[v];
      is_free_[v] = is_free[vertex] != 0 && goal.mesh.is_on_line(vertex) && !is_at_end_[v] &&
                    !goal.holds(vertex);
    }
  }

  void run() {
    std::size_t left = 0;
    for (std::uint32_t v = 0; v < is_free_.size(); ++v) {
      if (!is_within_line(v)) continue;
      ++left;
      put_in_queue(v);
    }
    const auto wanted =
        static_cast<std::size_t>(std::sqrt(goal_.share) * static_cast<double>(left));
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
    is_at_end_.assign(mesh_.origin.size(), false);
    std::vector<std::pair<Edge, std::uint32_t>> edges;
    edges.reserve(3 * mesh_.triangles.size());
    for (std::uint32_t t = 0; t < mesh_.triangles.size(); ++t) {
      const auto& [a, b, c] = mesh_.triangles[t];
      for (const Edge& side : {edge(a, b), edge(b, c), edge(c, a)}) edges.emplace_back(side, t);
    }
    std::ranges::sort(edges);
    for (std::size_t begin = 0; begin < edges.size();) {
      std::size_t end = begin;
      while (end < edges.size() && edges[end].first == edges[begin].first) ++end;
      const auto [a, b] = edges[begin].first;
      const bool is_within_wall = end - begin == 2 && block_.sides[edges[begin].second] ==
                                                          block_.sides[edges[begin + 1].second];
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
    for (const std::uint32_t first : around_[v]) {
      if (!has(mesh_.triangles[first], from)) continue;
      std::uint32_t at = from;
      std::uint32_t triangle = first;
      for (std::size_t steps = 0; steps <= around_[v].size(); ++steps) {
        ++seen;
        at = third(triangle, v, at);
        if (at == to) break;
        const auto next = std::ranges::find_if(around_[v], [&](std::uint32_t t) {
          return t != triangle && has(mesh_.triangles[t], at);
        });
        if (at == from || next == around_[v].end()) return false;
        triangle = *next;
      }
    }
    return seen == around_[v].size();
  }

  void put_in_queue(std::uint32_t v) {
    const Edge beside = edge(on_line_beside_[v][0], on_line_beside_[v][1]);
    const Corners segment = {mesh_.at(beside.first), mesh_.at(beside.second),
                             mesh_.at(beside.second)};
    double farthest = squared_distance(mesh_.at(v), segment);
    for (const std::uint32_t end : on_line_beside_[v]) {
      const auto passed = passed_.find(edge(v, end));
      if (passed == passed_.end()) continue;
      for (const std::uint32_t vertex : passed->second) {
        farthest = std::max(farthest, squared_distance(mesh_.at(vertex), segment));
      }
    }
    if (farthest <= squared_line_bound_) queue_.push({farthest, v, version_[v]});
  }

  // Into the nearer of its neighbours on the line, or the other one.
  bool collapse(std::uint32_t v) {
    std::array<std::uint32_t, 2> ends = {on_line_beside_[v][0], on_line_beside_[v][1]};
    const auto length = [&](std::uint32_t end) {
      const Point along = minus(mesh_.at(end), mesh_.at(v));
      return std::pair(dot(along, along), end);
    };
    if (length(ends[1]) < length(ends[0])) std::swap(ends[0], ends[1]);
    return collapse(v, ends[0], ends[1]) || collapse(v, ends[1], ends[0]);
  }

  bool collapse(std::uint32_t v, std::uint32_t into, std::uint32_t beyond) {
    const auto [gone, kept] = split_star(v, into);
    if (has(on_line_beside_[into], beyond) || !links_meet_at_edge(v, into, gone)) return false;
    if (!stays_upright(v, into, kept)) return false;
    std::vector<std::pair<std::uint32_t, std::uint32_t>> moves;
    if (goal_.grid != nullptr && !stays_near(v, into, gone, kept, moves)) return false;
    move(v, into, beyond, gone, kept);
    for (const auto& [n, t] : moves) points_[t].push_back(n);
    return true;
  }

  // True if the remaining triangles are near the original, and each point of the vertex's triangles
  // is near a remaining one of the same wall. Adds each point and its new triangle to `moves`.
  bool stays_near(std::uint32_t v, std::uint32_t into, const Numbers& gone, const Numbers& kept,
                  std::vector<std::pair<std::uint32_t, std::uint32_t>>& moves) {
    std::uint32_t guess = TriangleGrid::kNone;
    std::vector<Corners> shapes;
    for (const std::uint32_t t : kept) {
      const auto [a, b, c] = moved(t, v, into);
      const Corners& shape = shapes.emplace_back(Corners{mesh_.at(a), mesh_.at(b), mesh_.at(c)});
      Point centre;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        centre[axis] = (shape[0][axis] + shape[1][axis] + shape[2][axis]) / 3;
      }
      guess = goal_.grid->within(centre, squared_bound_, guess).triangle;
      if (guess == TriangleGrid::kNone) return false;
    }
    for (const Numbers* triangles : {&gone, &kept}) {
      for (const std::uint32_t t : *triangles) {
        for (const std::uint32_t n : points_[t]) {
          const std::optional<std::uint32_t> home = home_of(n, block_.sides[t], kept, shapes);
          if (!home) return false;
          moves.emplace_back(n, *home);
        }
      }
    }
    for (const std::uint32_t t : kept) points_[t].clear();
    return true;
  }

  // A triangle of the wall that is near the point.
  std::optional<std::uint32_t> home_of(std::uint32_t point, const WallSides& sides,
                                       const Numbers& kept,
                                       const std::vector<Corners>& shapes) const {
    const Point at = measured_point(goal_.original, block_.points[point]);
    for (std::size_t n = 0; n < kept.size(); ++n) {
      if (block_.sides[kept[n]] != sides) continue;
      if (squared_distance(at, shapes[n]) <= squared_bound_) return kept[n];
    }
    return std::nullopt;
  }

  void move(std::uint32_t v, std::uint32_t into, std::uint32_t beyond, const Numbers& gone,
            const Numbers& kept) {
    for (const std::uint32_t t : gone) points_[t].clear();
    collapse_edge(v, into, gone, kept);
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

  // Puts what is left into the block.
  void take() {
    SurfaceBlock left;
    left.points.swap(block_.points);
    left.homes.assign(left.points.size(), 0);
    for (std::uint32_t t = 0; t < mesh_.triangles.size(); ++t) {
      if (is_gone_[t]) continue;
      for (const std::uint32_t n : points_[t]) {
        left.homes[n] = static_cast<std::uint32_t>(left.triangles.size());
      }
      left.triangles.push_back(mesh_.in_mesh(mesh_.triangles[t]));
      left.sides.push_back(block_.sides[t]);
    }
    block_ = std::move(left);
  }

  const BlockGoal& goal_;
  SurfaceBlock& block_;
  const double squared_bound_;
  const double squared_line_bound_;
  std::vector<Numbers> points_;          // of each triangle, by their places in the block
  std::vector<Numbers> on_line_beside_;  // of each vertex its neighbours along lines
  std::vector<bool> is_at_end_;          // whether a surface ends at the vertex
  std::vector<bool> is_free_;
  std::map<Edge, Numbers> passed_;      // vertices that an edge of a line stands for
  std::vector<std::uint32_t> version_;  // of a vertex; a candidate of another one is out of date
  std::priority_queue<Candidate, std::vector<Candidate>, std::greater<>> queue_;
};

}  // namespace

void simplify_lines(const BlockGoal& goal, std::span<const std::uint8_t> is_free,
                    SurfaceBlock& block) {
  if (!block.triangles.empty()) LineSimplifier(goal, is_free, block).run();
}

}  // namespace isomesh::mesh
