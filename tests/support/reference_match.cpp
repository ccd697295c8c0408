#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <sstream>
#include <string>
#include <unordered_map>
#include <utility>

#include "tests/support/points.h"
#include "tests/support/reference.h"

namespace isomesh::test {
namespace {

// The largest error of rounding a position to float, in lattice units.
double rounding_of(const ReferenceMesh& reference) {
  double largest = 0;
  const mesh::Dims& d = reference.dims;
  for (unsigned corner = 0; corner < 8; ++corner) {
    const Point p =
        to_space(reference.to_space, {(corner & 1U) * (d.x - 1.0), (corner >> 1 & 1U) * (d.y - 1.0),
                                      (corner >> 2) * (d.z - 1.0)});
    for (const double coordinate : p) largest = std::max(largest, std::abs(coordinate));
  }
  const mesh::LatticeToSpace& map = reference.to_space;
  const double step = std::min({length(map.step_x), length(map.step_y), length(map.step_z)});
  return 2e-6 + 0x1p-22 * largest / step;
}

// The reference's vertices by position, in bins of the lattice.
class VertexBins {
 public:
  explicit VertexBins(const ReferenceMesh& reference) {
    for (std::uint32_t v = 0; v < reference.vertices.size(); ++v) {
      const Point p = reference.vertices[v].place();
      bins_[key(bin(p[0]), bin(p[1]), bin(p[2]))].push_back(v);
    }
  }

  // Calls visit(vertex) for all vertices within `radius`, and some others.
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

// A point relative to an edge: the fraction along it, and the distance from it. Points beyond the
// ends have a distance too.
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

// True between the exact fraction and the one clamped away from the ends, inclusive.
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
// a sample with the iso-value; then the edge through the point decides.
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

// On the edges of the box, vertices of a closed surface are close together and identified by their
// order: by the sample that owns their edge, then by direction.
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

// Between the inside sample and the border sample adjacent to the phantom; along the normals of the
// box's other faces it may have moved by up to a fifth.
bool cap_place_is_right(const Point& p, const ReferenceVertex& vertex,
                        const ReferenceMesh& reference, double rounding) {
  const std::array counts = {reference.dims.x, reference.dims.y, reference.dims.z};
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
    if (mesh.is_on_border(v) != reference.is_on_border(vertex)) {
      return testing::AssertionFailure() << "on_border is wrong at " << describe(p);
    }
    if (reference.is_phantom(vertex.outside)) {
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

// Rotated so that the smallest vertex is first, which keeps the winding.
NamedTriangle canonical(NamedTriangle t) {
  std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
  return t;
}

// A possible place of a triangle: its patch, the diagonal of the cut, and the side.
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

// The number of each patch's triangles found, by diagonal and side.
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

}  // namespace isomesh::test
