#include "tests/support/mesh_checks.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <set>
#include <sstream>

#include "tests/support/points.h"

namespace isomesh::test {
namespace {

// Disjoint sets of elements (union-find).
class Groups {
 public:
  explicit Groups(std::size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), 0U);
  }

  std::uint32_t find(std::uint32_t element) {
    while (parent_[element] != element) {
      parent_[element] = parent_[parent_[element]];
      element = parent_[element];
    }
    return element;
  }
  void join(std::uint32_t a, std::uint32_t b) { parent_[find(a)] = find(b); }

 private:
  std::vector<std::uint32_t> parent_;
};

// One list per vertex, stored contiguously.
template <class T>
class Lists {
 public:
  explicit Lists(const std::vector<std::uint32_t>& sizes) : begin_(sizes.size() + 1, 0) {
    std::partial_sum(sizes.begin(), sizes.end(), begin_.begin() + 1);
    fill_.assign(begin_.begin(), begin_.end() - 1);
    items_.resize(begin_.back());
  }
  void add(std::uint32_t list, const T& item) { items_[fill_[list]++] = item; }
  std::span<T> operator[](std::size_t list) {
    return std::span(items_).subspan(begin_[list], begin_[list + 1] - begin_[list]);
  }

 private:
  std::vector<std::uint64_t> begin_;
  std::vector<std::uint64_t> fill_;
  std::vector<T> items_;
};

// The two other corners of a triangle at a vertex, in the order of its winding.
using LinkEdge = std::array<std::uint32_t, 2>;

Lists<LinkEdge> links_of(const Surface& surface) {
  std::vector<std::uint32_t> sizes(surface.points.size(), 0);
  for (const auto& triangle : surface.triangles) {
    for (const std::uint32_t v : triangle) ++sizes[v];
  }
  Lists<LinkEdge> links(sizes);
  for (const auto& [a, b, c] : surface.triangles) {
    links.add(a, {b, c});
    links.add(b, {c, a});
    links.add(c, {a, b});
  }
  return links;
}

// True if the edges of a link, in their direction, form one path or one cycle.
bool is_one_fan(std::span<const LinkEdge> link) {
  const auto leaving = [&](std::uint32_t v) {
    return std::find_if(link.begin(), link.end(), [&](const LinkEdge& e) { return e[0] == v; });
  };
  const auto has_arriving = [&](std::uint32_t v) {
    return std::any_of(link.begin(), link.end(), [&](const LinkEdge& e) { return e[1] == v; });
  };
  auto start = std::find_if(link.begin(), link.end(),
                            [&](const LinkEdge& e) { return !has_arriving(e[0]); });
  if (start == link.end()) start = link.begin();  // a cycle: begin anywhere

  std::size_t steps = 0;
  auto edge = start;
  do {
    ++steps;
    edge = leaving((*edge)[1]);
  } while (edge != link.end() && edge != start && steps <= link.size());
  return steps == link.size();
}

// Directed edges, each listed at its smaller vertex as 2 * larger vertex + direction.
Lists<std::uint64_t> edges_of(const Surface& surface) {
  std::vector<std::uint32_t> sizes(surface.points.size(), 0);
  const auto for_each_edge = [&](const auto& visit) {
    for (const auto& [a, b, c] : surface.triangles) {
      visit(a, b);
      visit(b, c);
      visit(c, a);
    }
  };
  for_each_edge([&](std::uint32_t from, std::uint32_t to) { ++sizes[std::min(from, to)]; });
  Lists<std::uint64_t> edges(sizes);
  for_each_edge([&](std::uint32_t from, std::uint32_t to) {
    edges.add(std::min(from, to), std::uint64_t{std::max(from, to)} * 2 + (from < to ? 0 : 1));
  });
  return edges;
}

void count_edges(const Surface& surface, TopologyFacts& facts) {
  Lists<std::uint64_t> edges = edges_of(surface);
  for (std::uint32_t v = 0; v < surface.points.size(); ++v) {
    const std::span<std::uint64_t> list = edges[v];
    std::sort(list.begin(), list.end());
    for (std::size_t begin = 0; begin < list.size();) {
      const auto other = static_cast<std::uint32_t>(list[begin] / 2);
      std::array<std::uint64_t, 2> uses = {0, 0};
      std::size_t end = begin;
      for (; end < list.size() && list[end] / 2 == other; ++end) ++uses[list[end] % 2];
      ++facts.edges;
      if (uses[0] + uses[1] > 2) ++facts.crowded_edges;
      if (uses[0] > 1 || uses[1] > 1) ++facts.misoriented_edges;
      if (uses[0] + uses[1] == 1) {
        facts.boundary_edges.push_back(uses[0] == 1 ? DirectedEdge{v, other}
                                                    : DirectedEdge{other, v});
      }
      begin = end;
    }
  }
}

void count_components(const Surface& surface, TopologyFacts& facts) {
  const auto size = static_cast<std::uint32_t>(surface.points.size());
  std::vector<bool> used(size, false);
  Groups components(size);
  for (const auto& [a, b, c] : surface.triangles) {
    used[a] = used[b] = used[c] = true;
    components.join(a, b);
    components.join(b, c);
  }
  std::vector<bool> on_boundary(size, false);
  Groups loops(size);
  for (const auto& [from, to] : facts.boundary_edges) {
    on_boundary[from] = on_boundary[to] = true;
    loops.join(from, to);
  }
  for (std::uint32_t v = 0; v < size; ++v) {
    if (!used[v]) ++facts.unused_vertices;
    if (used[v] && components.find(v) == v) ++facts.components;
    if (on_boundary[v] && loops.find(v) == v) ++facts.boundary_loops;
  }
}

template <class T>
bool equal_bytes(const T* a, std::size_t a_size, const T* b, std::size_t b_size) {
  return a_size == b_size && (a_size == 0 || std::memcmp(a, b, a_size * sizeof(T)) == 0);
}

}  // namespace

Surface surface_of(const mesh::Mesh& mesh) {
  Surface surface;
  surface.points.reserve(mesh.positions.size());
  for (const mesh::Vec3& p : mesh.positions) surface.points.push_back({p[0], p[1], p[2]});
  surface.triangles.assign(mesh.triangles.begin(), mesh.triangles.end());
  return surface;
}

std::int64_t TopologyFacts::genus() const {
  return (2 * static_cast<std::int64_t>(components) - static_cast<std::int64_t>(boundary_loops) -
          euler) /
         2;
}

TopologyFacts topology_of(const Surface& surface) {
  TopologyFacts facts;
  for (const auto& [a, b, c] : surface.triangles) {
    if (a == b || b == c || c == a) ++facts.repeating_triangles;
  }
  count_edges(surface, facts);
  count_components(surface, facts);
  Lists<LinkEdge> links = links_of(surface);
  for (std::size_t v = 0; v < surface.points.size(); ++v) {
    if (!links[v].empty() && !is_one_fan(links[v])) ++facts.pinched_vertices;
  }
  facts.euler = static_cast<std::int64_t>(surface.points.size()) -
                static_cast<std::int64_t>(facts.edges) +
                static_cast<std::int64_t>(surface.triangles.size());
  return facts;
}

ExtentFacts extent_of(const Surface& surface, const Point& apex) {
  ExtentFacts facts;
  if (!surface.triangles.empty()) facts.smallest_area = std::numeric_limits<double>::infinity();
  for (const auto& [a, b, c] : surface.triangles) {
    const Point pa = minus(surface.points[a], apex);
    const Point pb = minus(surface.points[b], apex);
    const Point pc = minus(surface.points[c], apex);
    // Differences of the points: exact in double for floats.
    const Point ab = minus(surface.points[b], surface.points[a]);
    const Point ac = minus(surface.points[c], surface.points[a]);
    const double area = length(cross(ab, ac)) / 2;
    facts.area += area;
    facts.volume += dot(pa, cross(pb, pc)) / 6;
    facts.perimeter += length(ab) + length(ac) + length(minus(pc, pb));
    facts.smallest_area = std::min(facts.smallest_area, area);
    if (!(area > 0)) ++facts.flat_triangles;
  }
  if (!surface.points.empty()) facts.low = facts.high = surface.points.front();
  for (const Point& p : surface.points) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      facts.low[axis] = std::min(facts.low[axis], p[axis]);
      facts.high[axis] = std::max(facts.high[axis], p[axis]);
    }
  }
  return facts;
}

testing::AssertionResult is_sound(const Surface& surface) {
  for (const auto& triangle : surface.triangles) {
    for (const std::uint32_t v : triangle) {
      if (v >= surface.points.size()) {
        return testing::AssertionFailure()
               << "a triangle names vertex " << v << " of " << surface.points.size();
      }
    }
  }
  for (const Point& p : surface.points) {
    if (!std::isfinite(p[0]) || !std::isfinite(p[1]) || !std::isfinite(p[2])) {
      return testing::AssertionFailure() << "a position is not finite";
    }
  }
  const TopologyFacts topology = topology_of(surface);
  const ExtentFacts extent = extent_of(surface);
  std::ostringstream flaws;
  const auto note = [&](std::uint64_t count, const char* what) {
    if (count > 0) flaws << count << " " << what << "; ";
  };
  note(topology.repeating_triangles, "triangles with a repeated vertex");
  note(topology.crowded_edges, "edges of more than two triangles");
  note(topology.misoriented_edges, "edges whose triangles are wound against each other");
  note(topology.pinched_vertices, "vertices with more than one fan");
  note(topology.unused_vertices, "vertices without a triangle");
  note(extent.flat_triangles, "triangles of zero area");
  if (flaws.str().empty()) return testing::AssertionSuccess();
  return testing::AssertionFailure()
         << flaws.str() << "of " << surface.points.size() << " vertices and "
         << surface.triangles.size() << " triangles";
}

testing::AssertionResult boundary_is_on_border(const Surface& surface, const mesh::Dims& dims,
                                               const mesh::LatticeToSpace& map, double tolerance) {
  const std::array<double, 3> last = {dims.x - 1.0, dims.y - 1.0, dims.z - 1.0};
  for (const auto& [from, to] : topology_of(surface).boundary_edges) {
    const Point a = to_lattice(map, surface.points[from]);
    const Point b = to_lattice(map, surface.points[to]);
    bool on_face = false;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (const double face : {0.0, last[axis]}) {
        on_face = on_face ||
                  (std::abs(a[axis] - face) <= tolerance && std::abs(b[axis] - face) <= tolerance);
      }
    }
    if (!on_face) {
      return testing::AssertionFailure()
             << "a boundary edge from (" << a[0] << ", " << a[1] << ", " << a[2] << ") to (" << b[0]
             << ", " << b[1] << ", " << b[2] << ") is inside the lattice";
    }
  }
  return testing::AssertionSuccess();
}

void expect_layers(const mesh::Mesh& mesh) {
  ASSERT_EQ(mesh.layer_vertices.size(), mesh.layer_triangles.size());
  EXPECT_EQ(mesh.layer_vertices.front(), 0U);
  EXPECT_EQ(mesh.layer_vertices.back(), mesh.positions.size());
  EXPECT_EQ(mesh.layer_triangles.back(), mesh.triangles.size());
  EXPECT_TRUE(std::ranges::is_sorted(mesh.layer_vertices));
  for (std::size_t layer = 0; layer < mesh.layers(); ++layer) {
    const std::uint64_t low = mesh.layer_vertices[layer];
    const std::uint64_t high = mesh.layer_vertices[std::min(layer + 2, mesh.layers())];
    for (const mesh::Triangle& triangle : mesh.triangles_of(layer, layer + 1)) {
      for (const std::uint32_t vertex : triangle) {
        ASSERT_TRUE(vertex >= low && vertex < high) << layer;
      }
    }
  }
}

testing::AssertionResult same_bytes(const mesh::Mesh& a, const mesh::Mesh& b) {
  if (a.origin != b.origin) return testing::AssertionFailure() << "the origins differ";
  if (a.layer_vertices != b.layer_vertices || a.layer_triangles != b.layer_triangles) {
    return testing::AssertionFailure() << "the layers differ";
  }
  if (a.on_border != b.on_border) return testing::AssertionFailure() << "the borders differ";
  if (!equal_bytes(a.positions.data(), a.positions.size(), b.positions.data(),
                   b.positions.size())) {
    return testing::AssertionFailure() << "the positions differ";
  }
  if (!equal_bytes(a.triangles.data(), a.triangles.size(), b.triangles.data(),
                   b.triangles.size())) {
    return testing::AssertionFailure() << "the triangles differ";
  }
  return testing::AssertionSuccess();
}

std::vector<std::vector<std::uint32_t>> free_neighbors(const Surface& surface) {
  std::vector<std::set<std::uint32_t>> sets(surface.points.size());
  for (const auto& [a, b, c] : surface.triangles) {
    sets[a].insert({b, c});
    sets[b].insert({c, a});
    sets[c].insert({a, b});
  }
  for (const auto& [from, to] : topology_of(surface).boundary_edges) {
    sets[from].clear();
    sets[to].clear();
  }
  std::vector<std::vector<std::uint32_t>> lists;
  lists.reserve(sets.size());
  for (const auto& set : sets) lists.emplace_back(set.begin(), set.end());
  return lists;
}

Surface naively_smoothed(const Surface& surface, const std::vector<double>& shares) {
  const auto neighbors = free_neighbors(surface);
  Surface result = surface;
  for (const double share : shares) {
    const std::vector<Point> last = result.points;
    for (std::size_t v = 0; v < last.size(); ++v) {
      if (neighbors[v].empty()) continue;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        double sum = 0;
        for (const std::uint32_t n : neighbors[v]) sum += last[n][axis];
        const double mean = sum / static_cast<double>(neighbors[v].size());
        result.points[v][axis] = static_cast<float>(last[v][axis] + share * (mean - last[v][axis]));
      }
    }
  }
  return result;
}

std::vector<bool> corners_of_flat(const std::vector<Point>& points,
                                  const std::vector<mesh::Triangle>& triangles) {
  std::vector<bool> result(points.size());
  for (const auto& [a, b, c] : triangles) {
    const Point normal = cross(minus(points[b], points[a]), minus(points[c], points[a]));
    if (length(normal) < 2e-4) result[a] = result[b] = result[c] = true;
  }
  return result;
}

}  // namespace isomesh::test
