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

KeptPoints::KeptPoints(const WalledSurface& original, const WallGrids& grids, double max_error_mm)
    : original_(original),
      grids_(grids),
      squared_mm_(std::pow(kWithin * max_error_mm, 2)),
      first_(original.view.triangles.size(), kNone),
      next_(original.view.positions.size() + original.view.triangles.size(), kNone) {
  std::vector<bool> is_placed(original.view.positions.size(), false);
  for (std::uint32_t t = 0; t < first_.size(); ++t) {
    const auto add = [&](std::uint32_t point) { next_[point] = std::exchange(first_[t], point); };
    add(static_cast<std::uint32_t>(is_placed.size() + t));
    for (const std::uint32_t vertex : original.view.triangles[t]) {
      if (!is_placed[vertex]) add(vertex);
      is_placed[vertex] = true;
    }
  }
}

bool KeptPoints::replace(std::span<const std::uint32_t> star, std::span<const Shape> shapes) {
  thread_local std::vector<std::pair<std::uint32_t, std::uint32_t>> moves;  // keeps its memory
  moves.clear();
  for (const std::uint32_t t : star) {
    for (std::uint32_t point = first_[t]; point != kNone; point = next_[point]) {
      const std::uint32_t home = home_of(point, t, shapes);
      if (home == kNone) return false;
      moves.emplace_back(point, home);
    }
  }
  if (!std::ranges::all_of(shapes, [&](const Shape& shape) { return is_near(shape); })) {
    return false;
  }
  for (const std::uint32_t t : star) first_[t] = kNone;
  for (const auto& [point, home] : moves) next_[point] = std::exchange(first_[home], point);
  return true;
}

// At its centre, and at the middles of its new edges, which are often farther.
bool KeptPoints::is_near(const Shape& shape) const {
  const auto& [a, b, c] = shape.corners;
  const TriangleGrid& grid = grids_.grid_of(shape.triangle);
  const std::uint32_t guess = grids_.number_in_grid(shape.triangle);
  const auto is_near = [&](const Point& sum, double share) {
    const Point place = {sum[0] * share, sum[1] * share, sum[2] * share};
    return grid.within(place, squared_mm_, guess).triangle != kNone;
  };
  return is_near(plus(plus(a, b), c), 1.0 / 3) && is_near(plus(a, b), 0.5) &&
         (!shape.is_third_new || is_near(plus(c, a), 0.5));
}

std::uint32_t KeptPoints::home_of(std::uint32_t point, std::uint32_t triangle,
                                  std::span<const Shape> shapes) const {
  const Point at = measured_point(original_.view, point);
  const auto own = std::ranges::find(shapes, triangle, &Shape::triangle);
  if (own != shapes.end() && squared_distance(at, own->corners) <= squared_mm_) return triangle;
  for (const Shape& shape : shapes) {
    if (original_.sides_of(shape.triangle) != original_.sides_of(triangle)) continue;
    if (squared_distance(at, shape.corners) <= squared_mm_) return shape.triangle;
  }
  return kNone;
}

}  // namespace isomesh::mesh::collapse
