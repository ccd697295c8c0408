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

// A triangle with all corners in the border.
struct Candidate {
  double area = 0;  // twice
  std::uint32_t triangle = 0;
};

// By area, because bevelled edges have many small ones.
std::vector<Candidate> candidates_of(const Mesh& mesh, const SurfaceView& view) {
  std::vector<Candidate> candidates;
  for (std::uint32_t t = 0; t < view.triangles.size(); ++t) {
    const bool is_on_border = std::ranges::all_of(
        view.triangles[t], [&](std::uint32_t v) { return mesh.is_on_border(v); });
    if (!is_on_border) continue;
    const Corners corners = corners_of(view, t);
    const double area = length(normal_of(corners[0], corners[1], corners[2]));
    const Point edge = minus(corners[1], corners[0]);
    if (area > kLeastShape * dot(edge, edge)) candidates.push_back({area, t});
  }
  std::ranges::sort(candidates, [](const Candidate& a, const Candidate& b) {
    return std::pair(-a.area, a.triangle) < std::pair(-b.area, b.triangle);
  });
  return candidates;
}

// Half the distance between neighbours in single precision at the largest coordinate.
double rounding_of(std::span<const Vec3> positions) {
  float largest = 0;
  for (const Vec3& position : positions) {
    for (const float x : position) largest = std::max(largest, std::abs(x));
  }
  return std::ldexp(double{largest}, -24);
}

}  // namespace

Caps::Caps(const Mesh& mesh, std::span<const Triangle> triangles) {
  if (mesh.on_border.empty()) return;
  const SurfaceView view = {mesh.positions, triangles};
  const std::vector<Candidate> candidates = candidates_of(mesh, view);
  const double rounding = rounding_of(mesh.positions);
  std::size_t in_front = 0;  // the last vertex that was; many planes have the same one
  for (const Candidate& candidate : candidates) {
    if (planes_.size() == kMostPlanes) return;
    const Corners corners = corners_of(view, candidate.triangle);
    const double edge = length(minus(corners[1], corners[0]));
    const double depth = kDepth * edge + 4 * rounding;
    const Point unit = scaled(normal_of(corners[0], corners[1], corners[2]), 1 / candidate.area);
    const bool is_known = std::ranges::any_of(planes_, [&](const Plane& plane) {
      return dot(plane.normal, unit) > kLeastCosine &&
             std::abs(dot(plane.normal, corners[0]) - plane.offset) < depth;
    });
    if (is_known) continue;
    // Rounded corners turn the plane of a triangle by so much, and all of them together hardly.
    const Slope slope = {corners[0], 4 * rounding * edge / candidate.area};
    Plane plane = {unit, dot(unit, corners[0])};
    if (!is_behind(mesh, plane, depth, slope, in_front)) continue;
    Point sum = {0, 0, 0};
    for (const Candidate& other : candidates) {
      const Corners others = corners_of(view, other.triangle);
      const double most = depth + slope.rise * length(minus(others[0], slope.from));
      const Point normal = normal_of(others[0], others[1], others[2]);
      const bool is_same = dot(plane.normal, normal) > kLeastCosine * other.area &&
                           std::abs(dot(plane.normal, others[0]) - plane.offset) < most;
      if (is_same) sum = plus(sum, normal);
    }
    plane.normal = scaled(sum, 1 / length(sum));
    plane.offset = dot(plane.normal, corners[0]);
    planes_.push_back(plane);
  }
}

// A triangle at an edge of the box may lie across a part of the surface.
bool Caps::is_behind(const Mesh& mesh, const Plane& plane, double depth, const Slope& slope,
                     std::size_t& in_front) {
  const auto is_in_front = [&](const Vec3& position) {
    const Point place = to_point(position);
    const double height = dot(plane.normal, place) - plane.offset;
    return !(height < depth || height < depth + slope.rise * length(minus(place, slope.from)));
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
