#include "server/mesh/collapse/caps.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
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
  const SurfaceView view = {mesh.positions, triangles};
  struct Candidate {
    double area;  // twice
    std::uint32_t triangle;
  };
  // Those of large triangles come first, because bevelled edges have many small ones.
  std::vector<Candidate> candidates;
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    const bool is_on_border =
        std::ranges::all_of(triangles[t], [&](std::uint32_t v) { return mesh.is_on_border(v); });
    if (!is_on_border) continue;
    const Corners corners = corners_of(view, t);
    candidates.push_back({length(normal_of(corners[0], corners[1], corners[2])), t});
  }
  std::ranges::sort(candidates, [](const Candidate& a, const Candidate& b) {
    return std::pair(-a.area, a.triangle) < std::pair(-b.area, b.triangle);
  });
  std::size_t in_front = 0;  // the last vertex that was; many planes have the same one
  for (const auto& [area, triangle] : candidates) {
    if (planes_.size() == kMostPlanes) return;
    const Corners corners = corners_of(view, triangle);
    const Point edge = minus(corners[1], corners[0]);
    if (!(area > kLeastShape * dot(edge, edge))) continue;
    const Point unit = scaled(normal_of(corners[0], corners[1], corners[2]), 1 / area);
    const Plane plane = {unit, dot(unit, corners[0])};
    const double depth = kDepth * length(edge);
    const bool is_known = std::ranges::any_of(planes_, [&](const Plane& other) {
      return dot(other.normal, unit) > kLeastCosine &&
             std::abs(other.offset - plane.offset) < depth;
    });
    if (!is_known && is_behind(mesh, plane, depth, in_front)) planes_.push_back(plane);
  }
}

// A triangle at an edge of the box may lie across a part of the surface.
bool Caps::is_behind(const Mesh& mesh, const Plane& plane, double depth, std::size_t& in_front) {
  const auto is_in_front = [&](const Vec3& position) {
    return !(dot(plane.normal, to_point(position)) - plane.offset < depth);
  };
  if (is_in_front(mesh.positions[in_front])) return false;
  const auto found = std::ranges::find_if(mesh.positions, is_in_front);
  if (found == mesh.positions.end()) return true;
  in_front = static_cast<std::size_t>(found - mesh.positions.begin());
  return false;
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
