// The comparison of the kernels' meshes with the scalar surface.
#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/points.h"
#include "tests/support/scalar_surface.h"

namespace isomesh::test {
namespace {

Point in_cells(const HalfCells& p) { return {p[0] / 2.0, p[1] / 2.0, p[2] / 2.0}; }

Point place_of(const ScalarCrossing& crossing) {
  return between(in_cells(crossing.inside), in_cells(crossing.outside), crossing.share);
}

Point place_of(const ScalarVertex& vertex) {
  Point sum = {0, 0, 0};
  for (const ScalarCrossing& crossing : vertex.crossings) {
    const Point p = place_of(crossing);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      sum[axis] += p[axis] / static_cast<double>(vertex.crossings.size());
    }
  }
  return sum;
}

// The largest error of rounding a position to float, in lattice units.
double rounding_of(const ScalarSurface& reference) {
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

// How far the kernels may keep a crossing from the ends of its edge, as a share of it: on the rims
// of caps eight times as far as elsewhere.
double end_margin_of(const ScalarCrossing& crossing) {
  const bool is_half = ((crossing.inside[0] ^ crossing.outside[0]) & 1) != 0;
  return (is_half ? 2 : 1) * (crossing.is_on_border ? 8 : 1) * kEndMargin;
}

// On its edge, between the exact share and the one kept off the ends.
bool is_on_edge(const Point& p, const ScalarCrossing& crossing, double rounding) {
  const Point from = in_cells(crossing.inside);
  const Point to = in_cells(crossing.outside);
  const Point way = minus(to, from);
  const double share = dot(minus(p, from), way) / dot(way, way);
  const Point nearest = between(from, to, std::clamp(share, 0.0, 1.0));
  const double margin = end_margin_of(crossing);
  const double kept_off = std::clamp(crossing.share, margin, 1 - margin);
  return length(minus(p, nearest)) < 3 * rounding &&
         share >= std::min(crossing.share, kept_off) - 2 * rounding &&
         share <= std::max(crossing.share, kept_off) + 2 * rounding;
}

// Between the inside sample and the border sample adjacent to the phantom; along the normals of the
// box's other faces it may have moved by up to a fifth.
bool is_on_cap(const Point& p, const ScalarCrossing& crossing, const ScalarSurface& reference,
               double rounding) {
  const Point inside = in_cells(crossing.inside);
  const Point outside = in_cells(crossing.outside);
  const std::array counts = {reference.dims.x, reference.dims.y, reference.dims.z};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double high = counts[axis] - 1.0;
    const double from = inside[axis];
    const double to = std::clamp<double>(outside[axis], 0, high);
    const bool may_give_way = inside[axis] == outside[axis];
    const double least = std::min(from, to) - (may_give_way && from == high ? 0.2 : 0);
    const double most = std::max(from, to) + (may_give_way && from == 0 ? 0.2 : 0);
    if (p[axis] < least - rounding || p[axis] > most + rounding) return false;
  }
  return true;
}

bool is_in_place(const Point& p, const ScalarVertex& vertex, const ScalarSurface& reference,
                 double rounding) {
  const ScalarCrossing& first = vertex.crossings.front();
  if (vertex.crossings.size() == 1) {
    return std::isnan(first.share) ? is_on_cap(p, first, reference, rounding)
                                   : is_on_edge(p, first, rounding);
  }
  double slack = 3 * rounding;
  for (const ScalarCrossing& crossing : vertex.crossings) {
    const double margin = end_margin_of(crossing);
    const bool is_moved = crossing.share < margin || crossing.share > 1 - margin;
    if (is_moved) slack += 4 * margin / static_cast<double>(vertex.crossings.size());
  }
  return length(minus(p, place_of(vertex))) < slack;
}

// Each turned so that its smallest vertex is first, which keeps the winding; in order.
std::vector<mesh::Triangle> sorted(std::span<const mesh::Triangle> triangles) {
  std::vector<mesh::Triangle> result(triangles.begin(), triangles.end());
  for (mesh::Triangle& t : result) std::rotate(t.begin(), std::ranges::min_element(t), t.end());
  std::ranges::sort(result);
  return result;
}

}  // namespace

Surface ScalarSurface::surface() const {
  Surface surface;
  for (const ScalarVertex& vertex : vertices) {
    surface.points.push_back(test::to_space(to_space, place_of(vertex)));
  }
  surface.triangles = triangles;
  return surface;
}

testing::AssertionResult matches(const mesh::Mesh& mesh, const ScalarSurface& reference) {
  if (mesh.layer_vertices != reference.layer_vertices ||
      mesh.layer_triangles != reference.layer_triangles ||
      mesh.positions.size() != reference.vertices.size() ||
      mesh.triangles.size() != reference.triangles.size()) {
    return testing::AssertionFailure()
           << mesh.positions.size() << " vertices and " << mesh.triangles.size()
           << " triangles, or their layers, are not the reference's " << reference.vertices.size()
           << " and " << reference.triangles.size();
  }
  const double rounding = rounding_of(reference);
  const Surface surface = surface_of(mesh);
  for (std::size_t v = 0; v < reference.vertices.size(); ++v) {
    const ScalarVertex& vertex = reference.vertices[v];
    const Point p = to_lattice(reference.to_space, surface.points[v]);
    if (!is_in_place(p, vertex, reference, rounding)) {
      return testing::AssertionFailure()
             << "vertex " << v << " is in a wrong place: " << p[0] << ", " << p[1] << ", " << p[2];
    }
    if (mesh.is_on_border(v) != vertex.crossings.front().is_on_border) {
      return testing::AssertionFailure() << "on_border is wrong at vertex " << v;
    }
  }
  for (std::size_t k = 0; k < mesh.layers(); ++k) {
    const std::uint64_t begin = reference.layer_triangles[k];
    const auto wanted =
        std::span(reference.triangles).subspan(begin, reference.layer_triangles[k + 1] - begin);
    if (sorted(mesh.triangles_of(k, k + 1)) != sorted(wanted)) {
      return testing::AssertionFailure() << "the triangles of layer " << k << " are others";
    }
  }
  return testing::AssertionSuccess();
}

}  // namespace isomesh::test
