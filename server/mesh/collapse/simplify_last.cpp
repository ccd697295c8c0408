#include "server/mesh/collapse/simplify_last.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <optional>
#include <queue>
#include <tuple>
#include <utility>

#include "server/mesh/collapse/edge_collapses.h"
#include "server/mesh/measure/point_triangle.h"
#include "server/mesh/topology/vertex_fans.h"

namespace isomesh::mesh {
namespace {

constexpr std::size_t kCollapsesPerLook = 1024;  // at whether the job is cancelled
constexpr std::size_t kMostAround = 256;         // to look at takes the square of it

class LastSimplifier : private EdgeCollapses {
 public:
  LastSimplifier(std::span<const std::uint8_t> held, const Mesh& mesh,
                 const std::vector<Triangle>& current, const std::vector<WallSides>& sides)
      : EdgeCollapses(mesh, current), sides_(sides), version_(mesh_.origin.size(), 0) {
    for (std::uint32_t v = 0; v < mesh_.origin.size(); ++v) {
      const bool is_held = !held.empty() && held[mesh_.origin[v]] != 0;
      if (!is_held && is_free(mesh, v)) free_.push_back(v);
    }
  }

  bool can_collapse() {
    may_turn_ = true;
    return std::ranges::any_of(free_, [&](std::uint32_t v) { return best_of(v).has_value(); });
  }

  // Triangles are turned far only if that is the last way.
  void run(std::uint64_t triangles, const Context& context) {
    left_ = mesh_.triangles.size();
    for (const bool may_turn : {false, true}) {
      may_turn_ = may_turn;
      std::size_t before = 0;
      do {
        before = left_;
        for (const std::uint32_t v : free_) put_in_queue(v);
        empty_queue(triangles, context);
      } while (left_ < before && left_ > triangles);
    }
  }

  void take(std::vector<Triangle>& current, std::vector<WallSides>& sides) const {
    std::size_t count = 0;
    for (std::uint32_t t = 0; t < mesh_.triangles.size(); ++t) {
      if (is_gone_[t]) continue;
      current[count] = mesh_.in_mesh(mesh_.triangles[t]);
      if (!sides.empty()) sides[count] = sides[t];
      ++count;
    }
    current.resize(count);
    if (!sides.empty()) sides.resize(count);
  }

 private:
  // How far a vertex is from the surface without it, and how long the edge is that it goes along.
  struct Candidate {
    double squared_mm = 0;
    double squared_length = 0;
    std::uint32_t vertex = 0;
    std::uint32_t into = 0;
    std::uint32_t version = 0;

    auto key() const { return std::tuple(squared_mm, squared_length, vertex, into); }
    bool operator>(const Candidate& other) const { return key() > other.key(); }
  };

  // True if the triangles around the vertex form one closed fan within one wall.
  bool is_free(const Mesh& mesh, std::uint32_t v) const {
    if (sides_.empty() && mesh.is_on_line(mesh_.origin[v])) return false;
    std::vector<Corner> corners;
    for (const std::uint32_t t : around_[v]) {
      if (!sides_.empty() && sides_[t] != sides_[around_[v].front()]) return false;
      const Triangle& triangle = mesh_.triangles[t];
      const auto at = static_cast<std::size_t>(std::ranges::find(triangle, v) - triangle.begin());
      corners.push_back({triangle[(at + 1) % 3], triangle[(at + 2) % 3]});
    }
    Topology topology;
    check_vertex(corners, topology);
    return topology.manifold && topology.oriented && topology.boundary_edges == 0;
  }

  bool keeps_areas(std::uint32_t v, std::uint32_t into, const Numbers& kept) const {
    return std::ranges::all_of(kept,
                               [&](std::uint32_t t) { return mesh_.has_area(moved(t, v, into)); });
  }

  bool may_collapse(std::uint32_t v, std::uint32_t into, const Numbers& gone,
                    const Numbers& kept) const {
    const bool is_shaped = may_turn_ ? keeps_areas(v, into, kept) : stays_upright(v, into, kept);
    return is_shaped && links_meet_at_edge(v, into, gone);
  }

  Candidate candidate(std::uint32_t v, std::uint32_t into, const Numbers& kept) const {
    const Point along = minus(mesh_.at(into), mesh_.at(v));
    Candidate result = {.squared_mm = std::numeric_limits<double>::infinity(),
                        .squared_length = dot(along, along),
                        .vertex = v,
                        .into = into,
                        .version = version_[v]};
    for (const std::uint32_t t : kept) {
      const auto [a, b, c] = moved(t, v, into);
      const Corners shape = {mesh_.at(a), mesh_.at(b), mesh_.at(c)};
      result.squared_mm = std::min(result.squared_mm, squared_distance(mesh_.at(v), shape));
    }
    return result;
  }

  std::optional<Candidate> best_of(std::uint32_t v) const {
    std::optional<Candidate> best;
    if (around_[v].size() > kMostAround) return best;
    for (const std::uint32_t into : neighbours(v)) {
      const auto [gone, kept] = split_star(v, into);
      if (!may_collapse(v, into, gone, kept)) continue;
      const Candidate found = candidate(v, into, kept);
      if (!best || *best > found) best = found;
    }
    return best;
  }

  void put_in_queue(std::uint32_t v) {
    if (around_[v].empty()) return;
    if (const auto best = best_of(v)) queue_.push(*best);
  }

  void empty_queue(std::uint64_t triangles, const Context& context) {
    for (std::size_t n = 0; !queue_.empty() && left_ > triangles; ++n) {
      if (n % kCollapsesPerLook == 0) context.throw_if_stopped();
      const Candidate next = queue_.top();
      queue_.pop();
      if (next.version == version_[next.vertex]) collapse(next.vertex, next.into);
    }
    queue_ = {};
  }

  void collapse(std::uint32_t v, std::uint32_t into) {
    const auto [gone, kept] = split_star(v, into);
    // Vertices beyond the neighbours may have gone since.
    if (!links_meet_at_edge(v, into, gone)) return;
    const Numbers changed = neighbours(v);
    collapse_edge(v, into, gone, kept);
    left_ -= gone.size();
    ++version_[v];
    for (const std::uint32_t vertex : changed) ++version_[vertex];
    for (const std::uint32_t vertex : changed) {
      if (std::ranges::binary_search(free_, vertex)) put_in_queue(vertex);
    }
  }

  const std::vector<WallSides>& sides_;
  Numbers free_;                        // vertices that may go; ascending
  std::vector<std::uint32_t> version_;  // of a vertex; a candidate of another one is out of date
  std::priority_queue<Candidate, std::vector<Candidate>, std::greater<>> queue_;
  std::size_t left_ = 0;
  bool may_turn_ = false;
};

}  // namespace

void simplify_last(std::uint64_t triangles, std::span<const std::uint8_t> held,
                   const Context& context, const Mesh& mesh, std::vector<Triangle>& current,
                   std::vector<WallSides>& sides) {
  LastSimplifier last(held, mesh, current, sides);
  last.run(triangles, context);
  last.take(current, sides);
}

bool is_least(std::span<const std::uint8_t> held, const Mesh& mesh,
              const std::vector<Triangle>& current, const std::vector<WallSides>& sides) {
  return !LastSimplifier(held, mesh, current, sides).can_collapse();
}

}  // namespace isomesh::mesh
