#include "server/mesh/collapse/caps.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <utility>

#include "server/mesh/collapse/swept.h"
#include "server/mesh/measure/extent-inl.h"
#include "server/mesh/points.h"

namespace isomesh::mesh::collapse {
namespace {

// Triangles that tell a plane are no needles, and those of one plane differ by so little.
constexpr double kLeastShape = 0.02;  // twice the area by the square of an edge
constexpr double kLeastCosine = 0.9999;
constexpr double kDepth = 1e-3;  // as a share of an edge
constexpr std::size_t kMostPlanes = 64;

}  // namespace

Caps::Caps(const Mesh& mesh, std::span<const Triangle> triangles) {
  if (mesh.on_border.empty()) return;
  // Those of large triangles come first, because bevelled edges have many small ones.
  std::vector<std::pair<double, Corners>> found;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const bool is_on_border =
        std::ranges::all_of(triangles[t], [&](std::uint32_t v) { return mesh.is_on_border(v); });
    if (!is_on_border) continue;
    const Corners corners = corners_of({mesh.positions, triangles}, t);
    found.emplace_back(length(normal_of(corners[0], corners[1], corners[2])), corners);
  }
  std::ranges::stable_sort(found, std::greater(), [](const auto& each) { return each.first; });
  for (const auto& [area, corners] : found) {
    if (planes_.size() == kMostPlanes) return;
    const Point edge = minus(corners[1], corners[0]);
    if (!(area > kLeastShape * dot(edge, edge))) continue;
    const Point unit = scaled(normal_of(corners[0], corners[1], corners[2]), 1 / area);
    const Plane plane = {unit, dot(unit, corners[0])};
    const double depth = kDepth * length(edge);
    const bool is_known = std::ranges::any_of(planes_, [&](const Plane& other) {
      return dot(other.normal, unit) > kLeastCosine &&
             std::abs(other.offset - plane.offset) < depth;
    });
    if (!is_known && is_behind(mesh, plane, depth)) planes_.push_back(plane);
  }
}

// A triangle at an edge of the box may lie across a part of the surface.
bool Caps::is_behind(const Mesh& mesh, const Plane& plane, double depth) {
  return std::ranges::all_of(mesh.positions, [&](const Vec3& position) {
    return dot(plane.normal, to_point(position)) - plane.offset < depth;
  });
}

double Caps::share_of_way(const Point& place, const Point& way) const {
  double share = 1;
  for (const Plane& plane : planes_) {
    const double height = dot(plane.normal, place) - plane.offset;
    const double rise = dot(plane.normal, way);
    if (height < 0 && share * rise > -height / 2) share = -height / (2 * rise);
  }
  return share;
}

}  // namespace isomesh::mesh::collapse
