#include "server/mesh/measure.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

namespace isomesh::mesh {
namespace {

constexpr std::size_t kTrianglesPerChunk = 65536;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

using Point = std::array<double, 3>;

Point operator-(const Vec3& a, const Vec3& b) {
  return {double{a[0]} - b[0], double{a[1]} - b[1], double{a[2]} - b[2]};
}

Point cross(const Point& a, const Point& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

struct PartialExtent {
  double area = 0;
  double volume = 0;
  Point low = {kInfinity, kInfinity, kInfinity};
  Point high = {-kInfinity, -kInfinity, -kInfinity};
};

PartialExtent measure_chunk(const Mesh& mesh, std::size_t begin, std::size_t end) {
  PartialExtent part;
  for (std::size_t t = begin; t < end; ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    const Vec3& corner = mesh.positions[a];
    const Point normal = cross(mesh.positions[b] - corner, mesh.positions[c] - corner);
    const Point to_corner = {corner[0] - mesh.origin[0], corner[1] - mesh.origin[1],
                             corner[2] - mesh.origin[2]};
    part.area +=
        std::sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]) / 2;
    part.volume +=
        (to_corner[0] * normal[0] + to_corner[1] * normal[1] + to_corner[2] * normal[2]) / 6;
    for (const std::uint32_t vertex : {a, b, c}) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double at = mesh.positions[vertex][axis];
        part.low[axis] = std::min(part.low[axis], at);
        part.high[axis] = std::max(part.high[axis], at);
      }
    }
  }
  return part;
}

// Disjoint sets of vertices, each named by its smallest member.
class Components {
 public:
  explicit Components(std::size_t vertices) : parent_(vertices) {
    std::iota(parent_.begin(), parent_.end(), 0U);
  }

  void join(std::uint32_t a, std::uint32_t b) {
    a = root(a);
    b = root(b);
    if (a == b) return;
    parent_[std::max(a, b)] = std::min(a, b);
  }

  std::uint64_t count() const {
    std::uint64_t roots = 0;
    for (std::uint32_t v = 0; v < parent_.size(); ++v) roots += parent_[v] == v ? 1 : 0;
    return roots;
  }

 private:
  std::uint32_t root(std::uint32_t vertex) {
    while (parent_[vertex] != vertex) {
      parent_[vertex] = parent_[parent_[vertex]];
      vertex = parent_[vertex];
    }
    return vertex;
  }

  std::vector<std::uint32_t> parent_;
};

using DirectedEdge = std::pair<std::uint32_t, std::uint32_t>;

// The directed edges that no triangle runs through the other way. Only vertices whose next and
// previous corners do not balance lie on the boundary (see smooth.cpp), which leaves few to search.
std::uint64_t count_boundary_edges(const Mesh& mesh) {
  std::vector<std::uint32_t> balance(mesh.positions.size(), 0);
  for (const auto& [a, b, c] : mesh.triangles) {
    balance[a] += b - c;
    balance[b] += c - a;
    balance[c] += a - b;
  }
  std::vector<DirectedEdge> edges;
  for (const auto& [a, b, c] : mesh.triangles) {
    for (const auto& [from, to] : {DirectedEdge{a, b}, DirectedEdge{b, c}, DirectedEdge{c, a}}) {
      if (balance[from] != 0 && balance[to] != 0) edges.emplace_back(from, to);
    }
  }
  std::ranges::sort(edges);
  return static_cast<std::uint64_t>(std::ranges::count_if(edges, [&](const DirectedEdge& edge) {
    return !std::ranges::binary_search(edges, DirectedEdge{edge.second, edge.first});
  }));
}

}  // namespace

Extent measure_extent(const Mesh& mesh, const Context& context) {
  const std::size_t triangles = mesh.triangles.size();
  if (triangles == 0) return {};
  std::vector<PartialExtent> parts((triangles + kTrianglesPerChunk - 1) / kTrianglesPerChunk);
  parallel_for(context, parts.size(), [&](std::size_t chunk) {
    const std::size_t begin = chunk * kTrianglesPerChunk;
    parts[chunk] = measure_chunk(mesh, begin, std::min(triangles, begin + kTrianglesPerChunk));
  });
  PartialExtent whole;
  for (const PartialExtent& part : parts) {
    whole.area += part.area;
    whole.volume += part.volume;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      whole.low[axis] = std::min(whole.low[axis], part.low[axis]);
      whole.high[axis] = std::max(whole.high[axis], part.high[axis]);
    }
  }
  return {whole.area, whole.volume, whole.low, whole.high};
}

Topology measure_topology(const Mesh& mesh, const Context& context) {
  Topology topology;
  topology.boundary_edges = count_boundary_edges(mesh);
  context.throw_if_stopped();
  Components components(mesh.positions.size());
  for (const auto& [a, b, c] : mesh.triangles) {
    components.join(a, b);
    components.join(a, c);
  }
  topology.components = components.count();
  const std::uint64_t edges = (3 * mesh.triangles.size() + topology.boundary_edges) / 2;
  topology.euler = static_cast<std::int64_t>(mesh.positions.size()) -
                   static_cast<std::int64_t>(edges) +
                   static_cast<std::int64_t>(mesh.triangles.size());
  return topology;
}

}  // namespace isomesh::mesh
