#include "tests/support/regular_reference.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numeric>
#include <set>
#include <tuple>
#include <utility>

#include "proto/samples.h"
#include "tests/support/points.h"
#include "tests/support/tetrahedra.h"

namespace isomesh::test {
namespace {

using Samples = std::set<Sample>;

// z first, as samples are stored.
bool is_before(const Sample& a, const Sample& b) {
  return std::tuple(a[2], a[1], a[0]) < std::tuple(b[2], b[1], b[0]);
}

// The neighbours of one sample, and of each of them those that are neighbours of both.
using Star = std::map<Sample, Samples>;

using Stars = std::map<Sample, Star>;

// Those of all samples of a lattice. Most tests ask for a few again and again.
const Stars& stars_of(const mesh::Dims& dims, Scheme scheme, std::uint32_t margin) {
  static std::map<std::tuple<std::uint32_t, std::uint32_t, std::uint32_t, Scheme, std::uint32_t>,
                  Stars>
      known;
  const auto [place, is_new] = known.try_emplace({dims.x, dims.y, dims.z, scheme, margin});
  Stars& stars = place->second;
  if (!is_new) return stars;
  for_each_tetrahedron(dims, scheme, margin, [&](const Tetrahedron& corners) {
    for (const Sample& centre : corners.samples) {
      for (const Sample& a : corners.samples) {
        for (const Sample& b : corners.samples) {
          if (a != centre && b != centre && a != b) stars[centre][a].insert(b);
        }
      }
    }
  });
  return stars;
}

// Those of `all` that can be reached from `first` through `all`.
Samples reached(const Star& star, const Samples& all, const Sample& first) {
  Samples found = {first};
  std::vector<Sample> open = {first};
  while (!open.empty()) {
    const Sample sample = open.back();
    open.pop_back();
    for (const Sample& next : star.at(sample)) {
      if (all.contains(next) && found.insert(next).second) open.push_back(next);
    }
  }
  return found;
}

bool is_connected(const Star& star, const Samples& all) {
  return reached(star, all, *all.begin()).size() == all.size();
}

std::vector<Samples> components_of(const Star& star, Samples all) {
  std::vector<Samples> components;
  while (!all.empty()) {
    components.push_back(reached(star, all, *all.begin()));
    for (const Sample& sample : components.back()) all.erase(sample);
  }
  return components;
}

Samples common(const Samples& a, const Samples& b) {
  Samples both;
  std::ranges::set_intersection(a, b, std::inserter(both, both.end()));
  return both;
}

// Whether `some` of the ring around a neighbour are none, or one run with two others left.
bool is_run(const Star& star, const Samples& ring, const Samples& some) {
  return some.empty() || (is_connected(star, some) && some.size() + 2 <= ring.size());
}

template <class T>
class RegularBuilder {
 public:
  RegularBuilder(const mesh::Lattice<T>& lattice, const mesh::ExtractOptions& options)
      : lattice_(lattice), options_(options), margin_(options.close ? 1 : 0) {
    reference_.plain = reference_surface(lattice, options);
    stars_ = &stars_of(reference_.plain.dims, options.scheme, margin_);
  }

  RegularReference build() {
    for (std::uint32_t v = 0; v < reference_.plain.vertices.size(); ++v) add_crossing(v);
    for (const auto& [sample, own] : own_) find_candidates(sample, own);
    for (const auto& [sample, candidates] : candidates_) {
      for (const Samples& component : candidates) {
        if (!clashes(sample, component)) join(sample, component);
      }
    }
    return std::move(reference_);
  }

 private:
  void add_crossing(std::uint32_t v) {
    const ReferenceVertex& vertex = reference_.plain.vertices[v];
    number_[{vertex.inside, vertex.outside}] = number_[{vertex.outside, vertex.inside}] = v;
    crossed_[vertex.inside].insert(vertex.outside);
    crossed_[vertex.outside].insert(vertex.inside);
    if (distance(vertex.inside) <= distance(vertex.outside)) {
      own_[vertex.inside].insert(vertex.outside);
    } else {
      own_[vertex.outside].insert(vertex.inside);
    }
    inside_.insert(vertex.inside);
  }

  float distance(const Sample& s) const {
    if (options_.interpolation == Interpolation::kMidpoint) return 0;
    if (reference_.plain.is_phantom(s)) return std::numeric_limits<float>::infinity();
    const mesh::Dims& dims = lattice_.dims;
    const T value =
        lattice_.samples[((s[2] - margin_) * dims.y + (s[1] - margin_)) * dims.x + s[0] - margin_];
    return static_cast<float>(std::abs(static_cast<double>(value) - options_.iso));
  }

  // Whether all samples around it are samples of the volume.
  bool is_within(const Sample& s) const {
    const mesh::Dims& dims = reference_.plain.dims;
    const std::array counts = {dims.x, dims.y, dims.z};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (s[axis] < 1 + margin_ || s[axis] + 1 + margin_ >= counts[axis]) return false;
    }
    return true;
  }

  void find_candidates(const Sample& sample, const Samples& own) {
    if (!is_within(sample)) return;
    const Star& star = stars_->at(sample);
    for (const Samples& component : components_of(star, own)) {
      Samples rest;
      for (const auto& [neighbour, ring] : star) {
        if (!component.contains(neighbour)) rest.insert(neighbour);
      }
      bool joins = !rest.empty() && is_connected(star, rest);
      for (const Sample& other : crossed_.at(sample)) {
        if (component.contains(other)) continue;
        const Samples& ring = star.at(other);
        joins = joins && is_run(star, ring, common(ring, component));
      }
      if (joins) candidates_[sample].push_back(component);
    }
  }

  bool clashes(const Sample& sample, const Samples& component) const {
    const Star& star = stars_->at(sample);
    for (const auto& [neighbour, ring] : star) {
      const auto theirs = candidates_.find(neighbour);
      if (theirs == candidates_.end() || !is_before(neighbour, sample) ||
          inside_.contains(neighbour) != inside_.contains(sample)) {
        continue;
      }
      for (const Samples& other : theirs->second) {
        if (!is_run(star, ring, common(ring, common(component, other)))) return true;
      }
    }
    return false;
  }

  void join(const Sample& sample, const Samples& component) {
    ReferenceCluster cluster = {sample, {}};
    for (const Sample& other : component) {
      cluster.vertices.push_back(number_.at({sample, other}));
    }
    std::ranges::sort(cluster.vertices);
    reference_.clusters.push_back(std::move(cluster));
  }

  const mesh::Lattice<T>& lattice_;
  const mesh::ExtractOptions& options_;
  const std::uint32_t margin_;
  RegularReference reference_;
  const Stars* stars_;
  std::map<std::pair<Sample, Sample>, std::uint32_t> number_;
  std::map<Sample, Samples> crossed_;
  std::map<Sample, Samples> own_;
  Samples inside_;  // of those at a crossing
  std::map<Sample, std::vector<Samples>> candidates_;
};

// The numbers that the kernels' plain mesh gives the reference's vertices: by the sample that owns
// the edge, then by the axes along which it runs.
std::vector<std::uint32_t> plain_numbers(const ReferenceMesh& plain) {
  const auto rank = [&](std::uint32_t v) {
    const auto& [a, b, fraction] = plain.vertices[v];
    unsigned axes = 0;
    Sample owner;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      owner[axis] = std::min(a[axis], b[axis]);
      axes |= a[axis] == b[axis] ? 0U : 1U << axis;
    }
    return std::tuple(owner[2], owner[1], owner[0], axes);
  };
  std::vector<std::uint32_t> order(plain.vertices.size());
  std::iota(order.begin(), order.end(), 0U);
  std::ranges::sort(order, {}, rank);
  std::vector<std::uint32_t> numbers(order.size());
  for (std::uint32_t n = 0; n < order.size(); ++n) numbers[order[n]] = n;
  return numbers;
}

constexpr std::uint32_t kAlone = ~0U;

// For each vertex of the kernels' plain mesh its cluster, or kAlone.
std::vector<std::uint32_t> clusters_of(const RegularReference& reference) {
  const std::vector<std::uint32_t> numbers = plain_numbers(reference.plain);
  std::vector<std::uint32_t> clusters(numbers.size(), kAlone);
  for (std::uint32_t c = 0; c < reference.clusters.size(); ++c) {
    for (const std::uint32_t v : reference.clusters[c].vertices) clusters[numbers[v]] = c;
  }
  return clusters;
}

// What each vertex of the plain mesh becomes in the regular one. It is read off the triangles,
// which are in the same order; empty if those are not the plain ones without those that vanish.
std::vector<std::uint32_t> mapping(const mesh::Mesh& regular, const mesh::Mesh& plain,
                                   const std::vector<std::uint32_t>& clusters) {
  std::vector<std::uint32_t> to(plain.positions.size(), kAlone);
  std::map<std::uint32_t, std::uint32_t> cluster_to;
  std::size_t next = 0;
  for (std::size_t layer = 0; layer < plain.layers(); ++layer) {
    if (next != regular.layer_triangles[layer]) return {};
    for (const mesh::Triangle& triangle : plain.triangles_of(layer, layer + 1)) {
      const auto joined = [&](std::size_t i, std::size_t j) {
        return clusters[triangle[i]] != kAlone && clusters[triangle[i]] == clusters[triangle[j]];
      };
      if (joined(0, 1) || joined(1, 2) || joined(2, 0)) continue;
      if (next == regular.triangles.size()) return {};
      const mesh::Triangle& kept = regular.triangles[next++];
      for (std::size_t i = 0; i < 3; ++i) {
        const std::uint32_t cluster = clusters[triangle[i]];
        std::uint32_t& place = cluster == kAlone
                                   ? to[triangle[i]]
                                   : cluster_to.try_emplace(cluster, kAlone).first->second;
        if (place != kAlone && place != kept[i]) return {};
        place = kept[i];
      }
    }
  }
  if (next != regular.triangles.size()) return {};
  for (std::size_t v = 0; v < to.size(); ++v) {
    if (clusters[v] != kAlone && cluster_to.contains(clusters[v])) to[v] = cluster_to[clusters[v]];
  }
  return to;
}

// The triangles of each connected component, by the smallest of its vertices.
std::map<std::uint32_t, std::vector<mesh::Triangle>> split(const mesh::Mesh& mesh) {
  std::vector<std::uint32_t> root(mesh.positions.size());
  std::iota(root.begin(), root.end(), 0U);
  const auto find = [&](std::uint32_t v) {
    while (root[v] != v) v = root[v] = root[root[v]];
    return v;
  };
  for (const auto& [a, b, c] : mesh.triangles) {
    for (const std::uint32_t other : {b, c}) {
      const auto [low, high] = std::minmax({find(a), find(other)});
      root[high] = low;
    }
  }
  std::map<std::uint32_t, std::vector<mesh::Triangle>> components;
  for (const mesh::Triangle& triangle : mesh.triangles) {
    components[find(triangle[0])].push_back(triangle);
  }
  return components;
}

TopologyFacts facts_of(const std::vector<mesh::Triangle>& triangles) {
  Surface surface;
  std::map<std::uint32_t, std::uint32_t> numbers;
  for (mesh::Triangle triangle : triangles) {
    for (std::uint32_t& v : triangle) {
      v = numbers.try_emplace(v, static_cast<std::uint32_t>(numbers.size())).first->second;
    }
    surface.triangles.push_back(triangle);
  }
  surface.points.resize(numbers.size());
  return topology_of(surface);
}

bool is_manifold(const TopologyFacts& facts) {
  return facts.crowded_edges + facts.misoriented_edges + facts.pinched_vertices +
             facts.repeating_triangles + facts.unused_vertices ==
         0;
}

}  // namespace

template <class T>
RegularReference regular_reference(const mesh::Lattice<T>& lattice,
                                   const mesh::ExtractOptions& options) {
  return RegularBuilder<T>(lattice, options).build();
}

testing::AssertionResult matches(const mesh::Mesh& regular, const mesh::Mesh& plain,
                                 const RegularReference& reference) {
  const std::vector<std::uint32_t> clusters = clusters_of(reference);
  if (clusters.size() != plain.positions.size()) {
    return testing::AssertionFailure() << "the plain mesh is not the reference's";
  }
  const std::size_t joined = static_cast<std::size_t>(
      std::ranges::count_if(clusters, [](std::uint32_t c) { return c != kAlone; }));
  const std::size_t expected = clusters.size() - joined + reference.clusters.size();
  if (regular.positions.size() != expected) {
    return testing::AssertionFailure()
           << regular.positions.size() << " vertices instead of " << expected;
  }
  const auto to = mapping(regular, plain, clusters);
  if (to.size() != clusters.size()) {
    return testing::AssertionFailure() << "the triangles are others";
  }
  std::vector<Point> sums(regular.positions.size(), Point{});
  std::vector<double> counts(sums.size());
  for (std::size_t v = 0; v < to.size(); ++v) {
    if (to[v] == kAlone) return testing::AssertionFailure() << "vertex " << v << " is gone";
    if (clusters[v] == kAlone && plain.positions[v] != regular.positions[to[v]]) {
      return testing::AssertionFailure() << "vertex " << v << " has moved";
    }
    if (plain.is_on_border(v) != regular.is_on_border(to[v])) {
      return testing::AssertionFailure() << "vertex " << v << " is on the border, or not";
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      sums[to[v]][axis] += double{plain.positions[v][axis]};
    }
    ++counts[to[v]];
  }
  for (std::size_t v = 0; v < sums.size(); ++v) {
    if (counts[v] == 0) return testing::AssertionFailure() << "nothing became vertex " << v;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double mean = sums[v][axis] / counts[v];
      if (std::abs(mean - double{regular.positions[v][axis]}) > 1e-6 * (1 + std::abs(mean))) {
        return testing::AssertionFailure() << "vertex " << v << " is not the mean";
      }
    }
  }
  return testing::AssertionSuccess();
}

testing::AssertionResult has_topology_of(const mesh::Mesh& regular, const mesh::Mesh& plain,
                                         const RegularReference& reference) {
  const auto to = mapping(regular, plain, clusters_of(reference));
  const auto before = split(plain);
  const auto after = split(regular);
  if (before.size() != after.size()) {
    return testing::AssertionFailure()
           << after.size() << " components instead of " << before.size();
  }
  std::map<std::uint32_t, std::uint32_t> component_of;  // of each regular vertex
  for (const auto& [root, triangles] : after) {
    for (const mesh::Triangle& triangle : triangles) {
      for (const std::uint32_t v : triangle) component_of[v] = root;
    }
  }
  for (const auto& [root, triangles] : before) {
    std::set<std::uint32_t> became;
    for (const mesh::Triangle& triangle : triangles) {
      for (const std::uint32_t v : triangle) became.insert(component_of[to[v]]);
    }
    if (became.size() != 1) return testing::AssertionFailure() << "a component was torn";
    const TopologyFacts old = facts_of(triangles);
    const TopologyFacts now = facts_of(after.at(*became.begin()));
    if (!is_manifold(now)) return testing::AssertionFailure() << "a component is no manifold";
    if (now.euler != old.euler || now.boundary_loops != old.boundary_loops) {
      return testing::AssertionFailure()
             << "a component of Euler number " << old.euler << " and " << old.boundary_loops
             << " boundary curves has " << now.euler << " and " << now.boundary_loops;
    }
  }
  std::set<mesh::Triangle> corners;
  for (mesh::Triangle triangle : regular.triangles) {
    std::ranges::sort(triangle);
    if (!corners.insert(triangle).second) {
      return testing::AssertionFailure() << "two triangles have the same corners";
    }
  }
  const TopologyFacts facts = topology_of(surface_of(regular));
  if (!is_manifold(facts)) return testing::AssertionFailure() << "it is no manifold";
  return testing::AssertionSuccess();
}

#define ISOMESH_INSTANTIATE(T, name, kType) \
  template RegularReference regular_reference(const mesh::Lattice<T>&, const mesh::ExtractOptions&);
ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_INSTANTIATE)
#undef ISOMESH_INSTANTIATE

}  // namespace isomesh::test
