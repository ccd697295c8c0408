#include "server/mesh/collapse/simplify_block.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include <meshoptimizer.h>

#include "server/mesh/topology/vertex_fans.h"

namespace isomesh::mesh {
namespace {

// Each level makes up to kAttempts attempts, with more vertices held each time. The next level
// multiplies the error and the reduction by kLess.
constexpr int kAttempts = 6;
constexpr int kLevels = 4;
constexpr double kLess = 0.5;
// After more failed attempts than this, many vertices are held or the request was lowered. The
// result is then simplified once more.
constexpr std::uint32_t kFewRepeated = 1;

using Flags = std::vector<std::uint8_t>;

// The topology of a connected part that simplification must preserve. Each part is compared, since
// a part that is lost changes the sums as much as a handle that is cut.
struct Shape {
  std::uint64_t boundary_edges = 0;
  std::int64_t euler = 0;
  std::uint32_t pieces = 0;  // it is in

  bool operator==(const Shape&) const = default;
};

// The topology around the vertices.
struct Fans {
  std::vector<Shape> shapes;         // of the part that is named as the vertex of this number
  std::vector<std::uint32_t> count;  // of a vertex that is not in the middle of one fan
};

// For each vertex one of its connected part, the same for all of a part.
std::vector<std::uint32_t> parts_of(std::size_t vertices, std::span<const Triangle> triangles) {
  std::vector<std::uint32_t> parts(vertices);  // a smaller one of its part, or itself
  std::iota(parts.begin(), parts.end(), 0U);
  const auto part_of = [&](std::uint32_t vertex) {
    while (parts[vertex] != vertex) vertex = parts[vertex] = parts[parts[vertex]];
    return vertex;
  };
  for (const Triangle& triangle : triangles) {
    for (const std::uint32_t vertex : triangle) {
      const std::uint32_t a = part_of(triangle[0]);
      const std::uint32_t b = part_of(vertex);
      parts[std::max(a, b)] = std::min(a, b);
    }
  }
  for (std::uint32_t v = 0; v < vertices; ++v) parts[v] = part_of(v);
  return parts;
}

// The triangles of each vertex.
class TrianglesOfVertices {
 public:
  TrianglesOfVertices(std::size_t vertices, std::span<const Triangle> triangles)
      : ends_(vertices + 1, 0) {
    for (const Triangle& triangle : triangles) {
      for (const std::uint32_t vertex : triangle) ++ends_[vertex + 1];
    }
    std::partial_sum(ends_.begin(), ends_.end(), ends_.begin());
    // While the lists are filled, an end is where its list goes on.
    members_.resize(3 * triangles.size());
    for (std::uint32_t t = 0; t < triangles.size(); ++t) {
      for (const std::uint32_t vertex : triangles[t]) members_[ends_[vertex]++] = t;
    }
  }

  std::span<const std::uint32_t> of(std::size_t vertex) const {
    const std::uint32_t begin = vertex == 0 ? 0 : ends_[vertex - 1];
    return std::span(members_).subspan(begin, ends_[vertex] - begin);
  }

 private:
  std::vector<std::uint32_t> ends_;
  std::vector<std::uint32_t> members_;
};

// Looks at the fans around all vertices, and sums up the shapes of `parts`. Marks in `faults` those
// that are not as a manifold has them.
Fans look_at_fans(std::span<const std::uint32_t> parts, std::span<const Triangle> triangles,
                  const Flags& exempt, Flags& faults) {
  const std::size_t vertices = parts.size();
  const TrianglesOfVertices lists(vertices, triangles);
  const std::vector<std::uint32_t> pieces = parts_of(vertices, triangles);
  std::vector<Corner> around;
  Fans fans = {std::vector<Shape>(vertices), std::vector<std::uint32_t>(vertices, 1)};
  std::vector<std::int64_t> triangles_in(vertices);
  for (const Triangle& triangle : triangles) ++triangles_in[parts[triangle[0]]];
  FanWalk walk;
  for (std::size_t v = 0; v < vertices; ++v) {
    around.clear();
    for (const std::uint32_t t : lists.of(v)) {
      const auto at =
          static_cast<std::size_t>(std::ranges::find(triangles[t], v) - triangles[t].begin());
      around.push_back({triangles[t][(at + 1) % 3], triangles[t][(at + 2) % 3]});
    }
    if (around.empty()) continue;
    Shape& shape = fans.shapes[parts[v]];
    ++shape.euler;
    if (pieces[v] == v) ++shape.pieces;
    if (walk.is_closed(around)) continue;
    Topology here;
    fans.count[v] = static_cast<std::uint32_t>(check_vertex(around, here));
    shape.boundary_edges += here.boundary_edges;
    // Two triangles back to back enclose nothing, and no file need be able to hold them.
    const bool is_double = around.size() == 2 && here.boundary_edges == 0;
    const bool is_sound = here.manifold && here.oriented && !is_double;
    if (exempt[v] == 0 && !is_sound) faults[v] = 1;
  }
  for (std::size_t part = 0; part < vertices; ++part) {
    Shape& shape = fans.shapes[part];
    const auto boundary = static_cast<std::int64_t>(shape.boundary_edges);
    shape.euler += triangles_in[part] - (3 * triangles_in[part] + boundary) / 2;
  }
  return fans;
}

// Triangles that share no edge with another one.
std::vector<std::uint32_t> lone_triangles(std::size_t vertices,
                                          std::span<const Triangle> triangles) {
  const TrianglesOfVertices lists(vertices, triangles);
  const auto is_shared = [&](std::uint32_t t, std::uint32_t from, std::uint32_t to) {
    return std::ranges::any_of(lists.of(from), [&](std::uint32_t other) {
      return other != t && std::ranges::find(triangles[other], to) != triangles[other].end();
    });
  };
  std::vector<std::uint32_t> alone;
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    const auto& [a, b, c] = triangles[t];
    if (!is_shared(t, a, b) && !is_shared(t, b, c) && !is_shared(t, c, a)) alone.push_back(t);
  }
  return alone;
}

// The corner opposite the longest edge. In a triangle without area it lies on that edge.
std::size_t corner_on_edge(const LocalMesh& mesh, const Triangle& triangle) {
  std::array<double, 3> opposite;
  for (std::size_t i = 0; i < 3; ++i) {
    const Point edge = minus(mesh.at(triangle[(i + 2) % 3]), mesh.at(triangle[(i + 1) % 3]));
    opposite[i] = dot(edge, edge);
  }
  return static_cast<std::size_t>(std::ranges::max_element(opposite) - opposite.begin());
}

// Removes triangles without area, which collapses along a straight line leave. The middle corner of
// such a triangle lies on its longest edge. The triangle beyond that edge is cut in two at this
// corner, and the flat triangle is dropped: the surface stays the same. Flat triangles whose three
// corners are in `left` stay.
void turn_flat_triangles(const LocalMesh& mesh, const Flags& left,
                         std::vector<Triangle>& triangles) {
  constexpr int kMostPasses = 8;
  for (int pass = 0; pass < kMostPasses; ++pass) {
    std::vector<std::uint32_t> flat;
    for (std::uint32_t t = 0; t < triangles.size(); ++t) {
      const auto is_left = [&](std::uint32_t vertex) { return left[vertex] != 0; };
      if (mesh.has_area(triangles[t]) || std::ranges::all_of(triangles[t], is_left)) continue;
      flat.push_back(t);
    }
    if (flat.empty()) return;
    const TrianglesOfVertices lists(mesh.positions.size(), triangles);
    Flags is_changed(triangles.size(), 0);
    for (const std::uint32_t t : flat) {
      const std::size_t corner = corner_on_edge(mesh, triangles[t]);
      const std::uint32_t middle = triangles[t][corner];
      const std::uint32_t from = triangles[t][(corner + 1) % 3];
      const std::uint32_t to = triangles[t][(corner + 2) % 3];
      for (const std::uint32_t beyond : lists.of(from)) {
        if (is_changed[t] != 0 || is_changed[beyond] != 0) continue;
        const Triangle other = triangles[beyond];
        const auto at = static_cast<std::size_t>(std::ranges::find(other, to) - other.begin());
        if (at == 3 || other[(at + 1) % 3] != from) continue;
        const std::uint32_t apex = other[(at + 2) % 3];
        if (apex == middle) continue;
        triangles[t] = {middle, from, apex};
        triangles[beyond] = {middle, apex, to};
        is_changed[t] = is_changed[beyond] = 1;
      }
    }
    if (std::ranges::find(is_changed, 1) == is_changed.end()) return;
  }
}

// A vertex that stands at the same place as two more is never moved (0.18 holds vertices by nothing
// else than what it takes for more than one seam).
constexpr int kCopiesThatHold = 2;

std::vector<Triangle> propose(const LocalMesh& mesh, const Flags& held, double error_mm,
                              std::size_t triangles) {
  std::vector<Vec3> positions = mesh.positions;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    if (held[v] != 0) positions.insert(positions.end(), kCopiesThatHold, mesh.positions[v]);
  }
  static_assert(sizeof(Triangle) == 3 * sizeof(unsigned));
  std::vector<Triangle> result(mesh.triangles.size());
  const float* coordinates = positions.front().data();
  const double extent = meshopt_simplifyScale(coordinates, positions.size(), sizeof(Vec3));
  const double error = extent > 0 ? std::min(error_mm / extent, 1.0) : 0;
  const std::size_t indices = meshopt_simplify(
      result.front().data(), mesh.triangles.front().data(), 3 * mesh.triangles.size(), coordinates,
      positions.size(), sizeof(Vec3), 3 * triangles, static_cast<float>(error),
      meshopt_SimplifyLockBorder, nullptr);
  result.resize(indices / 3);
  return result;
}

class BlockSimplifier {
 public:
  BlockSimplifier(const BlockGoal& goal, std::span<const std::uint32_t> held, SurfaceBlock& block)
      : goal_(goal),
        block_(block),
        squared_bound_(std::pow(kWithin * goal.max_error_mm, 2)),
        mesh_(goal.mesh, block.triangles),
        parts_(parts_of(mesh_.positions.size(), mesh_.triangles)),
        exempt_(mesh_.positions.size(), 0),
        is_flat_(mesh_.positions.size(), 0),
        was_alone_(mesh_.positions.size(), 0),
        held_(mesh_.positions.size(), 0) {
    for (std::size_t v = 0; v < exempt_.size(); ++v) {
      exempt_[v] = goal.mesh.is_on_line(mesh_.origin[v]) ? 1 : 0;
    }
    held_ = exempt_;
    // Vertices that are not manifold at the start are held, and exempt from later checks.
    before_ = look_at_fans(parts_, mesh_.triangles, exempt_, held_);
    exempt_ = held_;
    for (std::size_t v = 0; v < held_.size(); ++v) {
      if (goal.holds(mesh_.origin[v])) held_[v] = 1;
    }
    for (const Triangle& triangle : mesh_.triangles) {
      if (mesh_.has_area(triangle)) continue;
      for (const std::uint32_t vertex : triangle) is_flat_[vertex] = held_[vertex] = 1;
    }
    for (const std::uint32_t t : lone_triangles(was_alone_.size(), mesh_.triangles)) {
      for (const std::uint32_t vertex : mesh_.triangles[t]) was_alone_[vertex] = 1;
    }
    faults_.assign(held_.size(), 0);
    for (const std::uint32_t vertex : held) {
      const auto found = std::ranges::lower_bound(mesh_.origin, vertex);
      if (found == mesh_.origin.end() || *found != vertex) continue;
      faults_[static_cast<std::size_t>(found - mesh_.origin.begin())] = 1;
    }
    if (!held.empty()) hold_faults();
  }

  // Once.
  BlockOutcome run() {
    BlockOutcome outcome;
    const auto all = static_cast<double>(mesh_.triangles.size());
    const Flags held_first = held_;
    double kept = goal_.share;
    double error = kFirstError * goal_.max_error_mm;
    for (int level = 0; level < kLevels; ++level) {
      // A smaller reduction may work without the vertices that the previous level held.
      held_ = held_first;
      for (int attempt = 0; attempt < kAttempts; ++attempt) {
        proposed_ = propose(mesh_, held_, error, static_cast<std::size_t>(std::floor(kept * all)));
        if (proposed_.size() == mesh_.triangles.size()) break;
        turn_flat_triangles(mesh_, is_flat_, proposed_);
        if (is_good()) {
          replace_block();
          return outcome;
        }
        ++outcome.repeated;
      }
      error *= kLess;
      kept = 1 - kLess * (1 - kept);
    }
    outcome.is_taken_back = outcome.repeated > 0;
    return outcome;
  }

 private:
  void replace_block() {
    block_.homes = std::move(homes_);
    block_.triangles.clear();
    for (const Triangle& triangle : proposed_) block_.triangles.push_back(mesh_.in_mesh(triangle));
    if (!block_.sides.empty()) block_.sides.resize(block_.triangles.size());
  }

  // Holds what is wrong with the proposal.
  bool is_good() {
    faults_.assign(held_.size(), 0);
    for (const Triangle& triangle : proposed_) {
      const auto was_flat = [&](std::uint32_t vertex) { return is_flat_[vertex] != 0; };
      if (!mesh_.has_area(triangle) && !std::ranges::all_of(triangle, was_flat)) mark(triangle);
    }
    // The block beyond the three edges of a lone one may come to the same one, back to back.
    for (const std::uint32_t t : lone_triangles(held_.size(), proposed_)) {
      const auto was_alone = [&](std::uint32_t vertex) { return was_alone_[vertex] != 0; };
      if (!std::ranges::all_of(proposed_[t], was_alone)) mark(proposed_[t]);
    }
    const Fans after = look_at_fans(parts_, proposed_, exempt_, faults_);
    for (std::size_t v = 0; v < faults_.size(); ++v) {
      const bool is_lost = after.shapes[parts_[v]].pieces == 0;
      const bool has_other_fans = exempt_[v] != 0 && !goal_.mesh.is_on_line(mesh_.origin[v]) &&
                                  after.count[v] != before_.count[v];
      if (is_lost || has_other_fans) faults_[v] = 1;
    }
    if (goal_.grid != nullptr) {
      measure_points();
      measure_centres();
    }
    if (std::ranges::find(faults_, 1) == faults_.end()) {
      if (after.shapes == before_.shapes) return true;
      // The place within the part cannot be told.
      for (std::size_t v = 0; v < faults_.size(); ++v) {
        if (after.shapes[parts_[v]] != before_.shapes[parts_[v]]) faults_[v] = 1;
      }
    }
    hold_faults();
    return false;
  }

  void mark(const Triangle& triangle) {
    for (const std::uint32_t vertex : triangle) faults_[vertex] = 1;
  }

  // From the original to the proposal.
  void measure_points() {
    const SurfaceView view(mesh_.positions, proposed_);
    const TriangleGrid grid(view, {});
    homes_.resize(block_.points.size());
    std::uint32_t guess = TriangleGrid::kNone;
    for (std::size_t n = 0; n < homes_.size(); ++n) {
      const Point point = measured_point(goal_.original, block_.points[n]);
      homes_[n] = grid.within(point, squared_bound_, guess).triangle;
      if (homes_[n] == TriangleGrid::kNone) {
        mark(mesh_.triangles[block_.homes[n]]);
      } else {
        guess = homes_[n];
      }
    }
  }

  // From the proposal to the original. Its vertices are the original's.
  void measure_centres() {
    Flags is_far(proposed_.size(), 0);
    std::uint32_t guess = TriangleGrid::kNone;
    for (std::size_t t = 0; t < proposed_.size(); ++t) {
      const SurfaceView one(mesh_.positions, {&proposed_[t], 1});
      const Point centre = measured_point(one, mesh_.positions.size());
      const std::uint32_t found = goal_.grid->within(centre, squared_bound_, guess).triangle;
      if (found != TriangleGrid::kNone) {
        guess = found;
        continue;
      }
      is_far[t] = 1;
      mark(proposed_[t]);
    }
    for (std::size_t n = 0; n < homes_.size(); ++n) {
      if (homes_[n] == TriangleGrid::kNone || is_far[homes_[n]] == 0) continue;
      mark(mesh_.triangles[block_.homes[n]]);
    }
  }

  // And their neighbours, or a collapse next to them would do the same again.
  void hold_faults() {
    for (const Triangle& triangle : mesh_.triangles) {
      const auto is_fault = [&](std::uint32_t vertex) { return faults_[vertex] != 0; };
      if (std::ranges::none_of(triangle, is_fault)) continue;
      for (const std::uint32_t vertex : triangle) held_[vertex] = 1;
    }
  }

  const BlockGoal& goal_;
  SurfaceBlock& block_;
  const double squared_bound_;
  const LocalMesh mesh_;
  const std::vector<std::uint32_t> parts_;
  Fans before_;
  Flags exempt_;     // vertices whose fans were no manifold's
  Flags is_flat_;    // of triangles that had no area
  Flags was_alone_;  // of triangles that shared no edge
  Flags held_;
  Flags faults_;
  std::vector<Triangle> proposed_;
  std::vector<std::uint32_t> homes_;
};

}  // namespace

LocalMesh::LocalMesh(const Mesh& mesh, std::span<const Triangle> block) {
  origin.reserve(3 * block.size());
  for (const Triangle& triangle : block) {
    origin.insert(origin.end(), triangle.begin(), triangle.end());
  }
  std::ranges::sort(origin);
  origin.erase(std::unique(origin.begin(), origin.end()), origin.end());
  for (const std::uint32_t vertex : origin) positions.push_back(mesh.positions[vertex]);
  const auto number = [&](std::uint32_t vertex) {
    return static_cast<std::uint32_t>(std::ranges::lower_bound(origin, vertex) - origin.begin());
  };
  for (const auto& [a, b, c] : block) triangles.push_back({number(a), number(b), number(c)});
}

BlockOutcome simplify_block(const BlockGoal& goal, std::span<const std::uint32_t> held,
                            SurfaceBlock& block) {
  if (block.triangles.empty()) return {};
  BlockOutcome outcome = BlockSimplifier(goal, held, block).run();
  // A second time would take the share that is aimed at from what is left.
  const bool is_done = goal.share > 0 || outcome.is_taken_back;
  if (!is_done && outcome.repeated > kFewRepeated) {
    outcome.repeated += BlockSimplifier(goal, held, block).run().repeated;
  }
  return outcome;
}

std::vector<SeamEdge> seam_edges(std::span<const Triangle> triangles) {
  std::vector<std::uint64_t> edges;
  edges.reserve(3 * triangles.size());
  for (const auto& [a, b, c] : triangles) {
    for (const auto& [from, to] : {std::pair(a, b), std::pair(b, c), std::pair(c, a)}) {
      edges.push_back(std::uint64_t{std::min(from, to)} << 32 | std::max(from, to));
    }
  }
  std::ranges::sort(edges);
  std::vector<SeamEdge> counted;
  std::vector<std::uint32_t> boundary;
  for (std::size_t begin = 0; begin < edges.size();) {
    std::size_t end = begin;
    while (end < edges.size() && edges[end] == edges[begin]) ++end;
    const SeamEdge edge = {static_cast<std::uint32_t>(edges[begin] >> 32),
                           static_cast<std::uint32_t>(edges[begin]),
                           static_cast<std::uint32_t>(end - begin)};
    counted.push_back(edge);
    if (edge.triangles == 1) boundary.insert(boundary.end(), {edge.low, edge.high});
    begin = end;
  }
  std::ranges::sort(boundary);
  const auto is_inner = [&](const SeamEdge& edge) {
    return !std::ranges::binary_search(boundary, edge.low) ||
           !std::ranges::binary_search(boundary, edge.high);
  };
  std::erase_if(counted, is_inner);
  return counted;
}

}  // namespace isomesh::mesh
