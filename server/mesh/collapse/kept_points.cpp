#include "server/mesh/collapse/kept_points.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace isomesh::mesh::collapse {
namespace {

constexpr std::uint32_t kNone = TriangleGrid::kNone;
// Keeps a distance that is measured again in single precision within the bound.
constexpr double kWithin = 1 - 1e-6;

}  // namespace

KeptPoints::KeptPoints(const SurfaceView& original, std::span<const WallSides> sides,
                       double max_error_mm, const Context& context)
    : original_(original),
      sides_(sides),
      squared_mm_(std::pow(kWithin * max_error_mm, 2)),
      grid_(original, context),
      first_(original.triangles.size(), kNone),
      next_(original.positions.size() + original.triangles.size(), kNone) {
  std::vector<bool> is_placed(original.positions.size(), false);
  for (std::uint32_t t = 0; t < first_.size(); ++t) {
    const auto add = [&](std::uint32_t point) { next_[point] = std::exchange(first_[t], point); };
    add(static_cast<std::uint32_t>(is_placed.size() + t));
    for (const std::uint32_t vertex : original.triangles[t]) {
      if (!is_placed[vertex]) add(vertex);
      is_placed[vertex] = true;
    }
  }
}

bool KeptPoints::replace(std::span<const std::uint32_t> star, std::span<const Shape> shapes) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> moves;
  for (const std::uint32_t t : star) {
    for (std::uint32_t point = first_[t]; point != kNone; point = next_[point]) {
      const std::uint32_t home = home_of(point, t, shapes);
      if (home == kNone) return false;
      moves.emplace_back(point, home);
    }
  }
  for (const Shape& shape : shapes) {
    Point centre;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      centre[axis] = (shape.corners[0][axis] + shape.corners[1][axis] + shape.corners[2][axis]) / 3;
    }
    if (grid_.within(centre, squared_mm_, shape.triangle).triangle == kNone) return false;
  }
  for (const std::uint32_t t : star) first_[t] = kNone;
  for (const auto& [point, home] : moves) next_[point] = std::exchange(first_[home], point);
  return true;
}

std::uint32_t KeptPoints::home_of(std::uint32_t point, std::uint32_t triangle,
                                  std::span<const Shape> shapes) const {
  const Point at = measured_point(original_, point);
  const auto own = std::ranges::find(shapes, triangle, &Shape::triangle);
  if (own != shapes.end() && squared_distance(at, own->corners) <= squared_mm_) return triangle;
  for (const Shape& shape : shapes) {
    if (!sides_.empty() && sides_[shape.triangle] != sides_[triangle]) continue;
    if (squared_distance(at, shape.corners) <= squared_mm_) return shape.triangle;
  }
  return kNone;
}

}  // namespace isomesh::mesh::collapse
