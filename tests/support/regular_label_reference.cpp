#include "tests/support/regular_label_reference.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "tests/support/joined.h"
#include "tests/support/points.h"
#include "tests/support/stars.h"

namespace isomesh::test {
namespace {

struct Candidates {
  std::vector<Samples> joined;  // several only where the star has two labels
  bool is_junction = false;

  Samples all() const {
    Samples all;
    for (const Samples& some : joined) all.insert(some.begin(), some.end());
    return all;
  }
};

class RegularLabelBuilder {
 public:
  RegularLabelBuilder(const mesh::Lattice<std::uint8_t>& lattice,
                      const mesh::SeparateOptions& options)
      : lattice_(lattice), options_(options), margin_(options.close ? 1 : 0) {
    reference_.plain = label_reference(lattice, options);
    dims_ = {lattice.dims.x + 2 * margin_, lattice.dims.y + 2 * margin_,
             lattice.dims.z + 2 * margin_};
    stars_ = &stars_of(dims_, options.scheme, margin_);
  }

  RegularLabelReference build() {
    for (std::uint32_t z = 0; z < dims_.z; ++z) {
      for (std::uint32_t y = 0; y < dims_.y; ++y) {
        for (std::uint32_t x = 0; x < dims_.x; ++x) find_candidates({x, y, z});
      }
    }
    for (const auto& [sample, candidates] : candidates_) {
      for (const Samples& some : candidates.joined) {
        if (!clashes(sample, candidates, some)) final_[sample].push_back(some);
      }
    }
    std::map<std::pair<Sample, std::size_t>, std::vector<std::uint32_t>> clusters;
    for (std::uint32_t v = 0; v < reference_.plain.vertices.size(); ++v) {
      const std::vector<Sample>& samples = reference_.plain.vertices[v].samples;
      const Sample owner = *std::ranges::max_element(
          samples, {}, [&](const Sample& sample) { return label(sample); });
      const auto found = final_.find(owner);
      if (found == final_.end()) continue;
      for (std::size_t c = 0; c < found->second.size(); ++c) {
        if (std::ranges::any_of(samples,
                                [&](const Sample& s) { return found->second[c].contains(s); })) {
          clusters[{owner, c}].push_back(v);
        }
      }
    }
    for (auto& [key, vertices] : clusters) reference_.clusters.push_back(std::move(vertices));
    return std::move(reference_);
  }

 private:
  bool is_within(const Sample& s) const {
    const std::array counts = {dims_.x, dims_.y, dims_.z};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (s[axis] < 1 + margin_ || s[axis] + 1 + margin_ >= counts[axis]) return false;
    }
    return true;
  }

  // Phantoms are background.
  std::size_t label(const Sample& s) const {
    const mesh::Dims& dims = lattice_.dims;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::uint32_t at = s[axis] - margin_;  // wraps before the first
      if (at >= std::array{dims.x, dims.y, dims.z}[axis]) return 0;
    }
    const std::int64_t value =
        lattice_.samples[((s[2] - margin_) * dims.y + (s[1] - margin_)) * dims.x + s[0] - margin_];
    const auto found = std::ranges::find(options_.labels, value);
    return found == options_.labels.end()
               ? 0
               : static_cast<std::size_t>(found - options_.labels.begin()) + 1;
  }

  Samples with_label(const Samples& samples, std::size_t wanted) const {
    Samples found;
    for (const Sample& sample : samples) {
      if (label(sample) == wanted) found.insert(sample);
    }
    return found;
  }

  std::set<std::size_t> labels_of(const Samples& samples) const {
    std::set<std::size_t> labels;
    for (const Sample& sample : samples) labels.insert(label(sample));
    return labels;
  }

  static bool is_disk(const Star& star, const Samples& some) {
    return is_connected(star, some) && leaves_connected(star, some);
  }

  static bool touches_nothing_twice(const Star& star, const Samples& some, const Samples& crossed) {
    return std::ranges::all_of(crossed, [&](const Sample& other) {
      const Samples& ring = star.at(other);
      return some.contains(other) || is_run(star, ring, common(ring, some));
    });
  }

  void find_candidates(const Sample& sample) {
    if (!is_within(sample)) return;
    const Star& star = stars_->at(sample);
    Samples own;
    Samples crossed;
    for (const auto& [neighbour, ring] : star) {
      if (label(neighbour) != label(sample)) crossed.insert(neighbour);
      if (label(neighbour) < label(sample)) own.insert(neighbour);
    }
    if (own.empty()) return;
    Candidates candidates = {{}, labels_of(crossed).size() > 1};
    for (const Samples& some :
         candidates.is_junction ? std::vector{own} : components_of(star, own)) {
      if (is_disk(star, some) && touches_nothing_twice(star, some, crossed) &&
          (!candidates.is_junction || labels_meet_well(star, some))) {
        candidates.joined.push_back(some);
      }
    }
    if (!candidates.joined.empty()) candidates_[sample] = std::move(candidates);
  }

  bool labels_meet_well(const Star& star, const Samples& own) const {
    const std::set<std::size_t> labels = labels_of(own);
    if (labels.size() > 3) return false;
    if (labels.size() == 1) return true;
    for (const std::size_t one : labels) {
      if (!is_disk(star, with_label(own, one))) return false;
      Samples others = own;
      for (const Sample& sample : with_label(own, one)) others.erase(sample);
      if (labels.size() == 3 && !is_disk(star, others)) return false;
    }
    return labels.size() < 3 || corners(star, own) == 1;
  }

  std::size_t corners(const Star& star, const Samples& own) const {
    std::size_t count = 0;
    for (const Sample& a : own) {
      for (const Sample& b : common(star.at(a), own)) {
        for (const Sample& c : common(star.at(b), common(star.at(a), own))) {
          count += a < b && b < c && labels_of({a, b, c}).size() == 3 ? 1 : 0;
        }
      }
    }
    return count;
  }

  bool clashes(const Sample& sample, const Candidates& mine, const Samples& some) const {
    const Star& star = stars_->at(sample);
    for (const auto& [neighbour, ring] : star) {
      const auto found = candidates_.find(neighbour);
      if (found == candidates_.end() || !is_before(neighbour, sample)) continue;
      const Candidates& theirs = found->second;
      if (mine.is_junction || theirs.is_junction) {
        if (!meet_well(star, ring, common(ring, common(mine.all(), theirs.all())))) return true;
        continue;
      }
      for (const Samples& other : theirs.joined) {
        if (label(sample) == label(neighbour) &&
            !is_run(star, ring, common(ring, common(some, other)))) {
          return true;
        }
      }
    }
    return false;
  }

  bool meet_well(const Star& star, const Samples& ring, const Samples& both) const {
    if (!is_run(star, ring, both)) return false;
    std::size_t changes = 0;
    for (const Sample& a : both) {
      for (const Sample& b : common(star.at(a), both)) {
        changes += a < b && label(a) != label(b) ? 1 : 0;
      }
    }
    return changes <= 1 && std::ranges::all_of(labels_of(both), [&](std::size_t one) {
             return is_run(star, ring, with_label(both, one));
           });
  }

  const mesh::Lattice<std::uint8_t>& lattice_;
  const mesh::SeparateOptions& options_;
  const std::uint32_t margin_;
  mesh::Dims dims_;
  const Stars* stars_;
  std::map<Sample, Candidates> candidates_;
  std::map<Sample, std::vector<Samples>> final_;
  RegularLabelReference reference_;
};

// The plain surface's vertices: their names in the reference, and the clusters that they become.
struct Joining {
  std::vector<std::uint32_t> names;
  std::vector<std::uint32_t> clusters;
  std::vector<std::uint32_t> to;  // empty if the triangles are others
};

Joining joining_of(const mesh::Mesh& regular, const mesh::Mesh& plain,
                   const RegularLabelReference& reference) {
  Joining joining;
  joining.names = names_of_vertices(plain, reference.plain);
  if (joining.names.size() != plain.positions.size()) return joining;
  std::vector<std::uint32_t> by_name(reference.plain.vertices.size(), kNotJoined);
  for (std::uint32_t c = 0; c < reference.clusters.size(); ++c) {
    for (const std::uint32_t v : reference.clusters[c]) by_name[v] = c;
  }
  for (const std::uint32_t name : joining.names) joining.clusters.push_back(by_name[name]);
  joining.to = joined_to(regular, plain, joining.clusters);
  return joining;
}

}  // namespace

RegularLabelReference regular_label_reference(const mesh::Lattice<std::uint8_t>& lattice,
                                              const mesh::SeparateOptions& options) {
  return RegularLabelBuilder(lattice, options).build();
}

testing::AssertionResult matches(const mesh::SeparatingSurface& regular,
                                 const mesh::SeparatingSurface& plain,
                                 const RegularLabelReference& reference) {
  const Joining joining = joining_of(regular.mesh, plain.mesh, reference);
  if (joining.to.empty() && plain.mesh.positions.size() != 0) {
    return testing::AssertionFailure() << "the triangles are others";
  }
  const std::size_t vertices = regular.mesh.positions.size();
  std::vector<std::size_t> most(vertices);  // samples of what became the vertex
  std::vector<Point> sums(vertices, Point{});
  std::vector<double> counts(vertices);
  for (std::size_t v = 0; v < joining.to.size(); ++v) {
    const std::uint32_t to = joining.to[v];
    if (to == kNotJoined) return testing::AssertionFailure() << "vertex " << v << " is gone";
    const LabelVertex& vertex = reference.plain.vertices[joining.names[v]];
    if (joining.clusters[v] == kNotJoined &&
        (plain.mesh.positions[v] != regular.mesh.positions[to] ||
         plain.mesh.is_on_border(v) != regular.mesh.is_on_border(to))) {
      return testing::AssertionFailure() << "vertex " << v << " has changed";
    }
    if (vertex.samples.size() < most[to]) continue;
    if (vertex.samples.size() > most[to]) {
      most[to] = vertex.samples.size();
      sums[to] = {};
      counts[to] = 0;
    }
    for (std::size_t axis = 0; axis < 3; ++axis) sums[to][axis] += vertex.at[axis];
    ++counts[to];
  }
  for (std::size_t v = 0; v < vertices; ++v) {
    if (counts[v] == 0) return testing::AssertionFailure() << "nothing became vertex " << v;
    if (regular.mesh.is_on_line(v) != (most[v] > 2)) {
      return testing::AssertionFailure() << "vertex " << v << ": on_line is wrong";
    }
    const mesh::Vec3& p = regular.mesh.positions[v];
    const Point at = to_lattice(reference.plain.to_space, {p[0], p[1], p[2]});
    for (double& sum : sums[v]) sum /= counts[v];
    if (!(length(minus(at, sums[v])) < 1e-3)) {
      return testing::AssertionFailure() << "vertex " << v << " is not the mean";
    }
  }
  return testing::AssertionSuccess();
}

testing::AssertionResult has_topology_of(const mesh::SeparatingSurface& regular,
                                         const mesh::SeparatingSurface& plain,
                                         const RegularLabelReference& reference) {
  const Joining joining = joining_of(regular.mesh, plain.mesh, reference);
  for (std::size_t label = 0; label <= plain.labels.size(); ++label) {
    const auto around = [&](const mesh::SeparatingSurface& surface) {
      std::vector<mesh::Triangle> triangles;
      for (std::size_t t = 0; t < surface.mesh.triangles.size(); ++t) {
        const bool is_front = surface.sides[t].front == label;
        const bool is_back = surface.sides[t].back == label;
        mesh::Triangle triangle = surface.mesh.triangles[t];
        if (is_front == is_back) continue;
        if (is_front) std::swap(triangle[1], triangle[2]);
        triangles.push_back(triangle);
      }
      return triangles;
    };
    const auto result = has_topology(around(regular), around(plain), joining.to);
    if (!result) return testing::AssertionFailure() << result.message() << ", label " << label;
  }
  return testing::AssertionSuccess();
}

}  // namespace isomesh::test
