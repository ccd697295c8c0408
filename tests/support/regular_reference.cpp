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
#include "tests/support/joined.h"
#include "tests/support/points.h"
#include "tests/support/stars.h"
#include "tests/support/tetrahedra.h"

namespace isomesh::test {
namespace {

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
      bool joins = leaves_connected(star, component);
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

// For each vertex of the kernels' plain mesh its cluster, or kNotJoined.
std::vector<std::uint32_t> clusters_of(const RegularReference& reference) {
  const std::vector<std::uint32_t> numbers = plain_numbers(reference.plain);
  std::vector<std::uint32_t> clusters(numbers.size(), kNotJoined);
  for (std::uint32_t c = 0; c < reference.clusters.size(); ++c) {
    for (const std::uint32_t v : reference.clusters[c].vertices) clusters[numbers[v]] = c;
  }
  return clusters;
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
      std::ranges::count_if(clusters, [](std::uint32_t c) { return c != kNotJoined; }));
  const std::size_t expected = clusters.size() - joined + reference.clusters.size();
  if (regular.positions.size() != expected) {
    return testing::AssertionFailure()
           << regular.positions.size() << " vertices instead of " << expected;
  }
  const auto to = joined_to(regular, plain, clusters);
  if (to.size() != clusters.size()) {
    return testing::AssertionFailure() << "the triangles are others";
  }
  std::vector<Point> sums(regular.positions.size(), Point{});
  std::vector<double> counts(sums.size());
  for (std::size_t v = 0; v < to.size(); ++v) {
    if (to[v] == kNotJoined) return testing::AssertionFailure() << "vertex " << v << " is gone";
    if (clusters[v] == kNotJoined && plain.positions[v] != regular.positions[to[v]]) {
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
  return has_topology(regular.triangles.span(), plain.triangles.span(),
                      joined_to(regular, plain, clusters_of(reference)));
}

#define ISOMESH_INSTANTIATE(T, name, kType) \
  template RegularReference regular_reference(const mesh::Lattice<T>&, const mesh::ExtractOptions&);
ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_INSTANTIATE)
#undef ISOMESH_INSTANTIATE

}  // namespace isomesh::test
