#include "tests/support/reference.h"

#include <algorithm>
#include <limits>
#include <map>
#include <utility>

#include "proto/samples.h"
#include "tests/support/points.h"
#include "tests/support/tetrahedra.h"

namespace isomesh::test {
namespace {

Point mean_in_space(const std::vector<Sample>& samples, const mesh::LatticeToSpace& map) {
  Point sum = {0, 0, 0};
  for (const Sample& s : samples) {
    const Point p = to_space(map, as_point(s));
    for (std::size_t axis = 0; axis < 3; ++axis) sum[axis] += p[axis];
  }
  for (double& coordinate : sum) coordinate /= static_cast<double>(samples.size());
  return sum;
}

template <class T>
class ReferenceBuilder {
 public:
  ReferenceBuilder(const mesh::Lattice<T>& lattice, const mesh::ExtractOptions& options)
      : lattice_(lattice), options_(options), margin_(options.close ? 1 : 0) {
    mesh_.closed = options.close;
    mesh_.dims = {lattice.dims.x + 2 * margin_, lattice.dims.y + 2 * margin_,
                  lattice.dims.z + 2 * margin_};
    mesh_.to_space = lattice.to_space;
    const double first = -static_cast<double>(margin_);
    mesh_.to_space.origin = to_space(lattice.to_space, {first, first, first});
  }

  ReferenceMesh build() {
    for_each_tetrahedron(mesh_.dims, options_.scheme, margin_, [&](const Tetrahedron& corners) {
      std::vector<Sample> inside;
      std::vector<Sample> outside;
      for (const Sample& sample : corners.samples) {
        (value(sample) >= static_cast<long double>(options_.iso) ? inside : outside)
            .push_back(sample);
      }
      if (!inside.empty() && !outside.empty()) add_patch(inside, outside, corners.layer);
    });
    return std::move(mesh_);
  }

 private:
  void add_patch(const std::vector<Sample>& inside, const std::vector<Sample>& outside,
                 std::uint32_t layer) {
    std::vector<std::pair<Sample, Sample>> edges;
    if (inside.size() == 2) {
      // Around the tetrahedron: consecutive edges share a sample.
      edges = {{inside[0], outside[0]},
               {inside[0], outside[1]},
               {inside[1], outside[1]},
               {inside[1], outside[0]}};
    } else {
      for (const Sample& a : inside) {
        for (const Sample& b : outside) edges.emplace_back(a, b);
      }
    }
    if (!faces_outside(edges, inside, outside)) std::reverse(edges.begin(), edges.end());
    ReferencePatch patch{{}, layer};
    for (const auto& [a, b] : edges) patch.corners.push_back(vertex(a, b));
    mesh_.patches.push_back(std::move(patch));
  }

  // Moving vertices along their edges never flips a patch, so the midpoints suffice.
  bool faces_outside(const std::vector<std::pair<Sample, Sample>>& edges,
                     const std::vector<Sample>& inside, const std::vector<Sample>& outside) const {
    const auto middle = [&](std::size_t n) {
      return to_space(mesh_.to_space,
                      between(as_point(edges[n].first), as_point(edges[n].second), 0.5));
    };
    const Point normal = cross(minus(middle(1), middle(0)), minus(middle(2), middle(0)));
    const Point outwards =
        minus(mean_in_space(outside, mesh_.to_space), mean_in_space(inside, mesh_.to_space));
    return dot(normal, outwards) > 0;
  }

  std::uint32_t vertex(const Sample& inside, const Sample& outside) {
    const auto [place, is_new] =
        numbers_.try_emplace(std::minmax({index(inside), index(outside)}),
                             static_cast<std::uint32_t>(mesh_.vertices.size()));
    if (is_new) mesh_.vertices.push_back({inside, outside, fraction(inside, outside)});
    return place->second;
  }

  double fraction(const Sample& inside, const Sample& outside) const {
    if (mesh_.is_phantom(outside)) return std::numeric_limits<double>::quiet_NaN();
    if (options_.interpolation == Interpolation::kMidpoint) return 0.5;
    return static_cast<double>((static_cast<long double>(options_.iso) - value(inside)) /
                               (value(outside) - value(inside)));
  }

  std::uint64_t index(const Sample& s) const {
    return (std::uint64_t{s[2]} * mesh_.dims.y + s[1]) * mesh_.dims.x + s[0];
  }

  // long double: the difference of two large doubles does not overflow.
  long double value(const Sample& s) const {
    if (mesh_.is_phantom(s)) return -std::numeric_limits<long double>::infinity();
    const mesh::Dims& dims = lattice_.dims;
    return lattice_
        .samples[((s[2] - margin_) * dims.y + (s[1] - margin_)) * dims.x + s[0] - margin_];
  }

  const mesh::Lattice<T>& lattice_;
  const mesh::ExtractOptions& options_;
  const std::uint32_t margin_;  // layers of phantoms
  ReferenceMesh mesh_;
  std::map<std::pair<std::uint64_t, std::uint64_t>, std::uint32_t> numbers_;
};

}  // namespace

std::uint64_t ReferenceMesh::triangles() const {
  std::uint64_t count = 0;
  for (const ReferencePatch& patch : patches) count += patch.corners.size() - 2;
  return count;
}

Point ReferenceVertex::place() const {
  return between(as_point(inside), as_point(outside), fraction);
}

bool ReferenceMesh::is_phantom(const std::array<std::uint32_t, 3>& sample) const {
  const std::array counts = {dims.x, dims.y, dims.z};
  for (std::size_t axis = 0; axis < 3 && closed; ++axis) {
    if (sample[axis] == 0 || sample[axis] + 1 == counts[axis]) return true;
  }
  return false;
}

bool ReferenceMesh::is_on_border(const ReferenceVertex& vertex) const {
  if (is_phantom(vertex.outside)) return true;
  const std::array counts = {dims.x, dims.y, dims.z};
  const std::uint32_t margin = closed ? 1 : 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::uint32_t at = vertex.inside[axis];
    if (at != vertex.outside[axis]) continue;
    if (at == margin || at + 1 + margin == counts[axis]) return true;
  }
  return false;
}

Surface ReferenceMesh::surface() const {
  Surface surface;
  for (const ReferenceVertex& vertex : vertices) {
    surface.points.push_back(test::to_space(to_space, vertex.place()));
  }
  for (const ReferencePatch& patch : patches) {
    const auto& c = patch.corners;
    surface.triangles.push_back({c[0], c[1], c[2]});
    if (c.size() == 4) surface.triangles.push_back({c[0], c[2], c[3]});
  }
  return surface;
}

template <class T>
ReferenceMesh reference_surface(const mesh::Lattice<T>& lattice,
                                const mesh::ExtractOptions& options) {
  return ReferenceBuilder<T>(lattice, options).build();
}

#define ISOMESH_INSTANTIATE(T, name, kType) \
  template ReferenceMesh reference_surface(const mesh::Lattice<T>&, const mesh::ExtractOptions&);
ISOMESH_FOR_EACH_SAMPLE_TYPE(ISOMESH_INSTANTIATE)
#undef ISOMESH_INSTANTIATE

}  // namespace isomesh::test
