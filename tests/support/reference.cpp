#include "tests/support/reference.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <span>
#include <sstream>
#include <string>
#include <unordered_map>
#include <utility>

namespace isomesh::test {
namespace {

using Sample = std::array<std::uint32_t, 3>;
using Tetrahedron = std::array<unsigned, 4>;

// The paper's Table 1.
constexpr Sample kCorners[8] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                                {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
constexpr Tetrahedron kSixTetrahedra[6] = {{0, 2, 3, 6}, {0, 1, 2, 6}, {0, 1, 5, 6},
                                           {0, 3, 6, 7}, {0, 4, 6, 7}, {0, 4, 5, 6}};
constexpr Tetrahedron kFiveTetrahedra[5] = {
    {0, 2, 3, 7}, {0, 1, 2, 5}, {0, 4, 5, 7}, {2, 5, 6, 7}, {0, 2, 5, 7}};

Point as_point(const Sample& s) {
  return {static_cast<double>(s[0]), static_cast<double>(s[1]), static_cast<double>(s[2])};
}

Point between(const Point& a, const Point& b, double share) {
  return {a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2])};
}

Point minus(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

double dot(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

Point cross(const Point& a, const Point& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

double length(const Point& a) { return std::sqrt(dot(a, a)); }

Point mean_in_space(const std::vector<Sample>& samples, const mesh::LatticeToSpace& map) {
  Point sum = {0, 0, 0};
  for (const Sample& s : samples) {
    const Point p = to_space(map, as_point(s));
    for (std::size_t axis = 0; axis < 3; ++axis) sum[axis] += p[axis];
  }
  for (double& coordinate : sum) coordinate /= static_cast<double>(samples.size());
  return sum;
}

std::array<std::uint32_t, 3> counts_of(const mesh::Dims& dims) { return {dims.x, dims.y, dims.z}; }

bool is_phantom(const Sample& s, const ReferenceMesh& mesh) {
  const auto counts = counts_of(mesh.dims);
  for (std::size_t axis = 0; axis < 3 && mesh.closed; ++axis) {
    if (s[axis] == 0 || s[axis] + 1 == counts[axis]) return true;
  }
  return false;
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
    if (!lattice_.dims.has_cells()) return std::move(mesh_);
    const mesh::Dims& dims = mesh_.dims;
    for (std::uint32_t k = 0; k + 1 < dims.z; ++k) {
      for (std::uint32_t j = 0; j + 1 < dims.y; ++j) {
        for (std::uint32_t i = 0; i + 1 < dims.x; ++i) add_cell({i, j, k});
      }
    }
    return std::move(mesh_);
  }

 private:
  void add_cell(const Sample& cell) {
    const bool five = options_.scheme == Scheme::kFive;
    // By the volume's own numbers, which are `margin_` smaller.
    const bool mirrored = five && (cell[0] + cell[1] + cell[2] + 3 * margin_) % 2 == 1;
    const std::span<const Tetrahedron> table =
        five ? std::span<const Tetrahedron>(kFiveTetrahedra) : kSixTetrahedra;
    for (const Tetrahedron& tetrahedron : table) {
      std::vector<Sample> inside;
      std::vector<Sample> outside;
      for (const unsigned corner : tetrahedron) {
        const Sample& c = kCorners[corner];
        const std::uint32_t x = mirrored ? 1 - c[0] : c[0];
        const Sample sample = {cell[0] + x, cell[1] + c[1], cell[2] + c[2]};
        (value(sample) >= static_cast<long double>(options_.iso) ? inside : outside)
            .push_back(sample);
      }
      if (!inside.empty() && !outside.empty()) add_patch(inside, outside, cell[2]);
    }
  }

  void add_patch(const std::vector<Sample>& inside, const std::vector<Sample>& outside,
                 std::uint32_t layer) {
    std::vector<std::pair<Sample, Sample>> edges;
    if (inside.size() == 2) {
      // Round the tetrahedron: neighbours share a sample.
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

  // Moving vertices along their edges never turns a patch over, so the middles tell for all.
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
    if (is_phantom(outside)) return std::numeric_limits<double>::quiet_NaN();
    if (options_.interpolation == Interpolation::kMidpoint) return 0.5;
    return static_cast<double>((static_cast<long double>(options_.iso) - value(inside)) /
                               (value(outside) - value(inside)));
  }

  std::uint64_t index(const Sample& s) const {
    return (std::uint64_t{s[2]} * mesh_.dims.y + s[1]) * mesh_.dims.x + s[0];
  }

  bool is_phantom(const Sample& s) const { return test::is_phantom(s, mesh_); }

  // The difference of two large doubles does not overflow a long double.
  long double value(const Sample& s) const {
    if (is_phantom(s)) return -std::numeric_limits<long double>::infinity();
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

Point exact_position(const ReferenceVertex& vertex) {
  return between(as_point(vertex.inside), as_point(vertex.outside), vertex.fraction);
}

// How much of a lattice unit the rounding of a position to float can be.
double rounding_of(const ReferenceMesh& reference) {
  double largest = 0;
  const mesh::Dims& d = reference.dims;
  for (const Sample& corner : kCorners) {
    const Point p = to_space(reference.to_space, {corner[0] * (d.x - 1.0), corner[1] * (d.y - 1.0),
                                                  corner[2] * (d.z - 1.0)});
    for (const double coordinate : p) largest = std::max(largest, std::abs(coordinate));
  }
  const mesh::LatticeToSpace& map = reference.to_space;
  const double step = std::min({length(map.step_x), length(map.step_y), length(map.step_z)});
  return 2e-6 + 0x1p-22 * largest / step;
}

// Vertices of the reference by where they are, in bins of the lattice.
class VertexBins {
 public:
  explicit VertexBins(const ReferenceMesh& reference) {
    for (std::uint32_t v = 0; v < reference.vertices.size(); ++v) {
      const Point p = exact_position(reference.vertices[v]);
      bins_[key(bin(p[0]), bin(p[1]), bin(p[2]))].push_back(v);
    }
  }

  // Calls visit(vertex) for all that may lie within `radius`, and some more.
  template <class Visit>
  void for_each_near(const Point& p, double radius, const Visit& visit) const {
    for (std::int64_t z = bin(p[2] - radius); z <= bin(p[2] + radius); ++z) {
      for (std::int64_t y = bin(p[1] - radius); y <= bin(p[1] + radius); ++y) {
        for (std::int64_t x = bin(p[0] - radius); x <= bin(p[0] + radius); ++x) {
          const auto found = bins_.find(key(x, y, z));
          if (found == bins_.end()) continue;
          for (const std::uint32_t v : found->second) visit(v);
        }
      }
    }
  }

 private:
  static std::int64_t bin(double coordinate) {
    return static_cast<std::int64_t>(std::floor(coordinate * 32));
  }
  static std::uint64_t key(std::int64_t x, std::int64_t y, std::int64_t z) {
    constexpr std::int64_t kBias = 1 << 10;
    return static_cast<std::uint64_t>(((z + kBias) << 42) + ((y + kBias) << 21) + x + kBias);
  }

  std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> bins_;
};

// Where a point lies by an edge: the share of the way along it, and the distance from it, which
// counts the ends: past them no point belongs to the edge.
struct EdgeCoordinates {
  double fraction;
  double distance;
};

EdgeCoordinates along_edge(const Point& p, const ReferenceVertex& vertex) {
  const Point a = as_point(vertex.inside);
  const Point ab = minus(as_point(vertex.outside), a);
  const double fraction = dot(minus(p, a), ab) / dot(ab, ab);
  const Point nearest = between(a, as_point(vertex.outside), std::clamp(fraction, 0.0, 1.0));
  return {fraction, length(minus(p, nearest))};
}

// Between the exact fraction and the one that is kept off the ends, ends of that range included.
bool fraction_is_right(double fraction, double exact, double rounding) {
  const double kept_off = std::clamp(exact, kEndMargin, 1 - kEndMargin);
  return fraction >= std::min(exact, kept_off) - rounding &&
         fraction <= std::max(exact, kept_off) + rounding;
}

std::string describe(const Point& p) {
  std::ostringstream text;
  text << "(" << p[0] << ", " << p[1] << ", " << p[2] << ")";
  return text.str();
}

// The reference's vertex for each of the mesh's, in `names`. Several can be close together, around
// a sample that has the iso-value; the edge that runs through the point tells which it is.
testing::AssertionResult match_vertices(const Surface& surface, const ReferenceMesh& reference,
                                        std::vector<std::uint32_t>& names) {
  const double rounding = rounding_of(reference);
  const VertexBins bins(reference);
  std::vector<bool> taken(reference.vertices.size(), false);
  for (const Point& point : surface.points) {
    const Point p = to_lattice(reference.to_space, point);
    double best_distance = 3 * rounding;
    auto best = static_cast<std::uint32_t>(reference.vertices.size());
    bins.for_each_near(p, 2 * kEndMargin + 3 * rounding, [&](std::uint32_t v) {
      const EdgeCoordinates place = along_edge(p, reference.vertices[v]);
      if (place.distance < best_distance &&
          fraction_is_right(place.fraction, reference.vertices[v].fraction, rounding)) {
        best_distance = place.distance;
        best = v;
      }
    });
    if (best == reference.vertices.size()) {
      return testing::AssertionFailure()
             << "no vertex of the reference is at " << describe(p) << " of the lattice";
    }
    if (taken[best]) {
      return testing::AssertionFailure()
             << "two vertices share the lattice edge at " << describe(p);
    }
    taken[best] = true;
    names.push_back(best);
  }
  return testing::AssertionSuccess();
}

// A closed surface's vertices are near each other on the edges of the box, so they are told apart
// by their order: that of the samples that own their edges, and at one sample that of the
// directions.
std::vector<std::uint32_t> in_order_of_owners(const ReferenceMesh& reference) {
  const auto key = [&](std::uint32_t v) {
    const auto& [inside, outside, fraction] = reference.vertices[v];
    std::array<std::uint32_t, 4> owner_and_direction = {};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      owner_and_direction[2 - axis] = std::min(inside[axis], outside[axis]);
      owner_and_direction[3] |= (inside[axis] != outside[axis] ? 1U : 0U) << axis;
    }
    return owner_and_direction;
  };
  std::vector<std::uint32_t> names(reference.vertices.size());
  std::iota(names.begin(), names.end(), 0U);
  std::ranges::sort(names, {}, key);
  return names;
}

// On the way from the inside sample to the border sample that the phantom is next to; across the
// other faces of the box that the edge lies in it may have given way by up to a fifth.
bool cap_place_is_right(const Point& p, const ReferenceVertex& vertex,
                        const ReferenceMesh& reference, double rounding) {
  const auto counts = counts_of(reference.dims);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double low = 1;
    const double high = counts[axis] - 2.0;
    const double from = vertex.inside[axis];
    const double to = std::clamp<double>(vertex.outside[axis], low, high);
    const bool may_give_way = vertex.inside[axis] == vertex.outside[axis];
    const double least = std::min(from, to) - (may_give_way && from == high ? 0.2 : 0);
    const double most = std::max(from, to) + (may_give_way && from == low ? 0.2 : 0);
    if (p[axis] < least - rounding || p[axis] > most + rounding) return false;
  }
  return true;
}

testing::AssertionResult match_closed_vertices(const mesh::Mesh& mesh,
                                               const ReferenceMesh& reference,
                                               std::vector<std::uint32_t>& names) {
  const double rounding = rounding_of(reference);
  names = in_order_of_owners(reference);
  const Surface surface = surface_of(mesh);
  for (std::size_t v = 0; v < names.size(); ++v) {
    const ReferenceVertex& vertex = reference.vertices[names[v]];
    const Point p = to_lattice(reference.to_space, surface.points[v]);
    if (mesh.is_on_border(v) != is_on_border(vertex, reference)) {
      return testing::AssertionFailure() << "on_border is wrong at " << describe(p);
    }
    if (is_phantom(vertex.outside, reference)) {
      if (cap_place_is_right(p, vertex, reference, rounding)) continue;
    } else {
      const EdgeCoordinates place = along_edge(p, vertex);
      const bool right = place.distance < 3 * rounding &&
                         fraction_is_right(place.fraction, vertex.fraction, rounding);
      if (right) continue;
    }
    return testing::AssertionFailure() << "the vertex at " << describe(p) << " is in a wrong place";
  }
  return testing::AssertionSuccess();
}

using NamedTriangle = std::array<std::uint32_t, 3>;

// Rotated so that the smallest vertex is first: the winding stays.
NamedTriangle canonical(NamedTriangle t) {
  std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
  return t;
}

// Which patch a triangle can belong to, cut along which of the two diagonals, and on which side.
struct TriangleRole {
  std::size_t patch;
  std::size_t diagonal;
  std::size_t side;
};

std::map<NamedTriangle, TriangleRole> roles_of(const ReferenceMesh& reference) {
  std::map<NamedTriangle, TriangleRole> roles;
  for (std::size_t n = 0; n < reference.patches.size(); ++n) {
    const auto& c = reference.patches[n].corners;
    roles[canonical({c[0], c[1], c[2]})] = {n, 0, 0};
    if (c.size() == 4) {
      roles[canonical({c[0], c[2], c[3]})] = {n, 0, 1};
      roles[canonical({c[0], c[1], c[3]})] = {n, 1, 0};
      roles[canonical({c[1], c[2], c[3]})] = {n, 1, 1};
    }
  }
  return roles;
}

// How often each triangle of a patch was found, by diagonal and side.
using PatchTally = std::array<std::array<unsigned, 2>, 2>;

bool is_complete(const PatchTally& tally, std::size_t corners) {
  if (corners == 3) return tally == PatchTally{{{1, 0}, {0, 0}}};
  return tally == PatchTally{{{1, 1}, {0, 0}}} || tally == PatchTally{{{0, 0}, {1, 1}}};
}

testing::AssertionResult match_triangles(const mesh::Mesh& mesh, const ReferenceMesh& reference,
                                         const std::vector<std::uint32_t>& names) {
  const auto roles = roles_of(reference);
  std::vector<PatchTally> found(reference.patches.size(), PatchTally{});
  for (std::size_t layer = 0; layer < mesh.layers(); ++layer) {
    for (std::size_t t = mesh.layer_triangles[layer]; t < mesh.layer_triangles[layer + 1]; ++t) {
      const auto& [a, b, c] = mesh.triangles[t];
      const auto role = roles.find(canonical({names[a], names[b], names[c]}));
      if (role == roles.end()) {
        return testing::AssertionFailure() << "triangle " << t << " is not the reference's";
      }
      if (reference.patches[role->second.patch].layer != layer) {
        return testing::AssertionFailure() << "triangle " << t << " is in layer " << layer;
      }
      ++found[role->second.patch][role->second.diagonal][role->second.side];
    }
  }
  for (std::size_t n = 0; n < found.size(); ++n) {
    if (!is_complete(found[n], reference.patches[n].corners.size())) {
      return testing::AssertionFailure() << "patch " << n << " is incomplete or there twice";
    }
  }
  return testing::AssertionSuccess();
}

testing::AssertionResult layers_are_right(const mesh::Mesh& mesh) {
  if (mesh.layer_vertices.size() != mesh.layer_triangles.size()) {
    return testing::AssertionFailure() << "the two lists of layers differ in length";
  }
  for (const auto& [offsets, total] : {std::pair(&mesh.layer_vertices, mesh.positions.size()),
                                       std::pair(&mesh.layer_triangles, mesh.triangles.size())}) {
    const bool covers =
        offsets->empty() ? total == 0 : offsets->front() == 0 && offsets->back() == total;
    if (!covers || !std::is_sorted(offsets->begin(), offsets->end())) {
      return testing::AssertionFailure() << "the layers do not divide the mesh";
    }
  }
  return testing::AssertionSuccess();
}

testing::AssertionResult vertices_are_in_their_layers(const mesh::Mesh& mesh,
                                                      const ReferenceMesh& reference,
                                                      const std::vector<std::uint32_t>& names) {
  for (std::size_t layer = 0; layer < mesh.layers(); ++layer) {
    for (std::size_t v = mesh.layer_vertices[layer]; v < mesh.layer_vertices[layer + 1]; ++v) {
      const ReferenceVertex& vertex = reference.vertices[names[v]];
      const std::size_t plane = std::min(vertex.inside[2], vertex.outside[2]);
      if (plane != layer) {
        return testing::AssertionFailure()
               << "vertex " << v << " of plane " << plane << " is in layer " << layer;
      }
    }
  }
  return testing::AssertionSuccess();
}

}  // namespace

std::uint64_t ReferenceMesh::triangles() const {
  std::uint64_t count = 0;
  for (const ReferencePatch& patch : patches) count += patch.corners.size() - 2;
  return count;
}

bool is_on_border(const ReferenceVertex& vertex, const ReferenceMesh& reference) {
  if (is_phantom(vertex.outside, reference)) return true;
  const auto counts = counts_of(reference.dims);
  const std::uint32_t margin = reference.closed ? 1 : 0;
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
    surface.points.push_back(test::to_space(to_space, exact_position(vertex)));
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

testing::AssertionResult matches(const mesh::Mesh& mesh, const ReferenceMesh& reference) {
  if (mesh.positions.size() != reference.vertices.size() ||
      mesh.triangles.size() != reference.triangles()) {
    return testing::AssertionFailure()
           << mesh.positions.size() << " vertices and " << mesh.triangles.size()
           << " triangles instead of " << reference.vertices.size() << " and "
           << reference.triangles();
  }
  if (const auto result = layers_are_right(mesh); !result) return result;
  std::vector<std::uint32_t> names;
  const auto vertices_match = reference.closed ? match_closed_vertices(mesh, reference, names)
                                               : match_vertices(surface_of(mesh), reference, names);
  if (!vertices_match) return vertices_match;
  if (const auto result = vertices_are_in_their_layers(mesh, reference, names); !result) {
    return result;
  }
  return match_triangles(mesh, reference, names);
}

template ReferenceMesh reference_surface(const mesh::Lattice<std::uint8_t>&,
                                         const mesh::ExtractOptions&);
template ReferenceMesh reference_surface(const mesh::Lattice<std::int8_t>&,
                                         const mesh::ExtractOptions&);
template ReferenceMesh reference_surface(const mesh::Lattice<std::uint16_t>&,
                                         const mesh::ExtractOptions&);
template ReferenceMesh reference_surface(const mesh::Lattice<std::int16_t>&,
                                         const mesh::ExtractOptions&);
template ReferenceMesh reference_surface(const mesh::Lattice<std::uint32_t>&,
                                         const mesh::ExtractOptions&);
template ReferenceMesh reference_surface(const mesh::Lattice<std::int32_t>&,
                                         const mesh::ExtractOptions&);
template ReferenceMesh reference_surface(const mesh::Lattice<float>&, const mesh::ExtractOptions&);
template ReferenceMesh reference_surface(const mesh::Lattice<double>&, const mesh::ExtractOptions&);

}  // namespace isomesh::test
