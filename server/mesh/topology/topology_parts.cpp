#include "server/mesh/topology/topology_parts.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <numeric>

#include "server/mesh/topology/vertex_fans.h"

namespace isomesh::mesh {
namespace {

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
constexpr std::size_t kWordBits = 64;

// The vertices that are inner in no part, numbered in the order of their first use.
class RimVertices {
 public:
  explicit RimVertices(std::size_t vertices)
      : open_((vertices + kWordBits - 1) / kWordBits, ~std::uint64_t{0}),
        before_(open_.size() + 1) {
    if (vertices % kWordBits != 0) open_.back() = (std::uint64_t{1} << vertices % kWordBits) - 1;
  }

  // False if one of them is inner in an earlier part.
  bool take_inner(const PartTopology& part) {
    std::uint64_t twice = 0;
    for (std::size_t i = 0; i < part.inner.size(); ++i) {
      std::uint64_t& open = open_[part.first_word + i];
      twice |= part.inner[i] & ~open;
      open &= ~part.inner[i];
    }
    return twice == 0;
  }

  // Call after all parts.
  void number() {
    for (std::size_t word = 0; word < open_.size(); ++word) {
      before_[word + 1] = before_[word] + static_cast<std::uint32_t>(std::popcount(open_[word]));
    }
  }

  std::size_t size() const { return before_.back(); }

  // kNone for an inner vertex.
  std::uint32_t number_of(std::uint32_t vertex) const {
    const std::uint64_t word = open_[vertex / kWordBits];
    const std::uint64_t bit = std::uint64_t{1} << vertex % kWordBits;
    if ((word & bit) == 0) return kNone;
    return before_[vertex / kWordBits] +
           static_cast<std::uint32_t>(std::popcount(word & (bit - 1)));
  }

 private:
  std::vector<std::uint64_t> open_;
  std::vector<std::uint32_t> before_;
};

// The corners of all parts, listed for each vertex of the rim. False if a vertex is inner in
// another part.
class RimCorners {
 public:
  bool fill(const RimVertices& vertices, std::span<const PartTopology> parts) {
    // Shifted by one: while the lists are filled, an end is where its list continues.
    ends_.assign(vertices.size() + 1, 0);
    for (const PartTopology& part : parts) {
      for (const PartTopology::RimCorner& corner : part.rim) {
        const std::uint32_t n = vertices.number_of(corner.vertex);
        if (n == kNone) return false;
        ++ends_[n + 1];
      }
    }
    std::partial_sum(ends_.begin(), ends_.end(), ends_.begin());
    corners_.resize(ends_.back());
    for (const PartTopology& part : parts) {
      for (const auto& [vertex, next, previous] : part.rim) {
        corners_[ends_[vertices.number_of(vertex)]++] = {next, previous};
      }
    }
    return true;
  }

  std::span<const Corner> of(std::size_t n) const {
    const std::uint32_t begin = n == 0 ? 0 : ends_[n - 1];
    return {corners_.data() + begin, ends_[n] - begin};
  }

 private:
  std::vector<std::uint32_t> ends_;
  std::vector<Corner> corners_;
};

// The components of all parts, joined at vertices that have several.
class RimComponents {
 public:
  RimComponents(const RimVertices& vertices, std::span<const PartTopology> parts)
      : first_(vertices.size(), kNone) {
    for (const PartTopology& part : parts) {
      const auto base = static_cast<std::uint32_t>(parent_.size());
      parent_.resize(parent_.size() + part.components);
      std::iota(parent_.begin() + base, parent_.end(), base);
      count_ += part.components;
      for (const auto& [vertex, component] : part.rim_components) {
        const std::uint32_t n = vertices.number_of(vertex);
        if (n == kNone) continue;  // its corners reveal it
        join(n, base + component);
      }
    }
  }

  bool is_known(std::size_t n) const { return first_[n] != kNone; }
  std::uint64_t count() const { return count_; }

 private:
  void join(std::uint32_t n, std::uint32_t component) {
    if (first_[n] == kNone) {
      first_[n] = component;
      return;
    }
    const std::uint32_t a = root(first_[n]);
    const std::uint32_t b = root(component);
    if (a == b) return;
    parent_[std::max(a, b)] = std::min(a, b);
    --count_;
  }

  std::uint32_t root(std::uint32_t component) {
    while (parent_[component] != component) {
      component = parent_[component] = parent_[parent_[component]];
    }
    return component;
  }

  std::vector<std::uint32_t> first_;  // component of each vertex of the rim
  std::vector<std::uint32_t> parent_;
  std::uint64_t count_ = 0;
};

}  // namespace

std::optional<Topology> join_topology(const Mesh& mesh, std::span<const PartTopology> parts,
                                      const Context& context) {
  RimVertices vertices(mesh.positions.size());
  for (const PartTopology& part : parts) {
    if (!vertices.take_inner(part)) return std::nullopt;
  }
  vertices.number();
  RimCorners corners;
  if (!corners.fill(vertices, parts)) return std::nullopt;
  context.throw_if_stopped();
  const RimComponents components(vertices, parts);
  Topology topology;
  topology.components = components.count();
  FanWalk walk;
  for (std::size_t n = 0; n < vertices.size(); ++n) {
    const std::span<const Corner> around = corners.of(n);
    if (around.empty()) {
      ++topology.components;  // a vertex without triangles
      continue;
    }
    if (!components.is_known(n)) return std::nullopt;
    if (!walk.is_closed(around)) check_vertex(around, topology);
  }
  topology.euler = euler_of(mesh, topology.boundary_edges);
  return topology;
}

}  // namespace isomesh::mesh
