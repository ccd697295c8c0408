#include "tests/support/regular_reference.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <set>
#include <tuple>
#include <utility>

#include "proto/samples.h"
#include "server/mesh/extract/nearness.h"
#include "tests/support/joined.h"
#include "tests/support/points.h"
#include "tests/support/reference.h"

namespace isomesh::test {
namespace {

class Joining {
 public:
  explicit Joining(const JoiningField& field)
      : field_(field), clusters_(field.crossings.size(), kNotJoined) {}

  std::vector<std::uint32_t> join() {
    for (std::uint32_t v = 0; v < field_.crossings.size(); ++v) add_crossing(v);
    for (const auto& [sample, own] : own_) find_candidates(sample, own);
    for (const auto& [sample, candidates] : candidates_) {
      for (const Samples& component : candidates) {
        if (!clashes(sample, component)) join(sample, component);
      }
    }
    return std::move(clusters_);
  }

 private:
  void add_crossing(std::uint32_t v) {
    const auto& [inside, outside] = field_.crossings[v];
    number_[{inside, outside}] = number_[{outside, inside}] = v;
    crossed_[inside].insert(outside);
    crossed_[outside].insert(inside);
    if (field_.distance(inside) <= field_.distance(outside)) {
      own_[inside].insert(outside);
    } else {
      own_[outside].insert(inside);
    }
    inside_.insert(inside);
  }

  void find_candidates(const Sample& sample, const Samples& own) {
    if (!field_.is_within(sample)) return;
    const Star& star = field_.stars.at(sample);
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
    const Star& star = field_.stars.at(sample);
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
    for (const Sample& other : component) clusters_[number_.at({sample, other})] = count_;
    ++count_;
  }

  const JoiningField& field_;
  std::vector<std::uint32_t> clusters_;
  std::uint32_t count_ = 0;
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

}  // namespace

std::vector<std::uint32_t> joined_crossings(const JoiningField& field) {
  return Joining(field).join();
}

template <class T>
std::vector<std::uint32_t> regular_clusters(const mesh::Lattice<T>& lattice,
                                            const mesh::ExtractOptions& options) {
  const ReferenceMesh plain = reference_surface(lattice, options);
  const std::uint32_t margin = options.close ? 1 : 0;
  std::vector<Crossing> crossings;
  for (const ReferenceVertex& vertex : plain.vertices) {
    crossings.push_back({vertex.inside, vertex.outside});
  }
  const double power = mesh::power_for(lattice.samples, lattice.dims.samples(), options.iso);
  const auto distance = [&](const Sample& s) {
    if (options.interpolation == Interpolation::kMidpoint) return 0.F;
    if (plain.is_phantom(s)) return std::numeric_limits<float>::infinity();
    const mesh::Dims& dims = lattice.dims;
    const T value =
        lattice.samples[((s[2] - margin) * dims.y + (s[1] - margin)) * dims.x + s[0] - margin];
    return static_cast<float>(std::abs(static_cast<double>(value) * power - options.iso * power));
  };
  const auto is_within = [&](const Sample& s) {
    const std::array counts = {plain.dims.x, plain.dims.y, plain.dims.z};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (s[axis] < 1 + margin || s[axis] + 1 + margin >= counts[axis]) return false;
    }
    return true;
  };
  const auto joined = joined_crossings(
      {stars_of(plain.dims, options.scheme, margin), crossings, distance, is_within});
  const std::vector<std::uint32_t> numbers = plain_numbers(plain);
  std::vector<std::uint32_t> clusters(numbers.size());
  for (std::size_t v = 0; v < numbers.size(); ++v) clusters[numbers[v]] = joined[v];
  return clusters;
}

testing::AssertionResult is_joined(const mesh::Mesh& regular, const mesh::Mesh& plain,
                                   std::span<const std::uint32_t> clusters) {
  if (clusters.size() != plain.positions.size()) {
    return testing::AssertionFailure() << "the plain mesh is not the reference's";
  }
  std::size_t expected = 0;
  std::set<std::uint32_t> several;
  for (const std::uint32_t c : clusters) {
    expected += c == kNotJoined || several.insert(c).second ? 1 : 0;
  }
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
  return has_topology(regular.triangles.span(), plain.triangles.span(), to);
}

#define ISOMESH_INSTANTIATE(T, name, kType)                                     \
  template std::vector<std::uint32_t> regular_clusters(const mesh::Lattice<T>&, \
                                                       const mesh::ExtractOptions&);
ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_INSTANTIATE)
#undef ISOMESH_INSTANTIATE

}  // namespace isomesh::test
