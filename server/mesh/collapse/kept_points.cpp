#include "server/mesh/collapse/kept_points.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace isomesh::mesh::collapse {
namespace {

constexpr std::uint32_t kNone = TriangleGrid::kNone;
// With less, there are more triangles; with more, more triangles are beyond the error between the
// samples.
constexpr double kSampleShare = 0.9;

}  // namespace

KeptPoints::KeptPoints(const WalledSurface& original, const WallGrids& grids, double max_error_mm,
                       std::span<const Care> care)
    : original_(original),
      grids_(grids),
      max_error_mm_(max_error_mm),
      squared_mm_(std::pow(kSampleShare * max_error_mm, 2)),
      care_(care),
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
  const auto vertices = static_cast<std::uint32_t>(original_.view.positions.size());
  std::vector<std::pair<std::uint32_t, std::uint32_t>> moves;
  bool takes_care = false;
  for (const std::uint32_t t : star) {
    for (std::uint32_t point = first_[t]; point != kNone; point = next_[point]) {
      const std::uint32_t home = home_of(point, t, shapes);
      if (home == kNone) return false;
      moves.emplace_back(point, home);
      if (!is_careful(point)) continue;
      takes_care = true;
      if (point >= vertices && !has_whole_triangle_near(point - vertices, t, shapes)) return false;
    }
  }
  const auto is_good = [&](const Shape& shape) { return is_near(shape, takes_care); };
  if (!std::ranges::all_of(shapes, is_good)) return false;
  for (const std::uint32_t t : star) first_[t] = kNone;
  for (const auto& [point, home] : moves) next_[point] = std::exchange(first_[home], point);
  return true;
}

bool KeptPoints::is_careful(std::uint32_t point) const {
  if (care_.empty()) return false;
  const auto takes_care = [&](std::uint32_t vertex) { return care_[vertex] != Care::kSamples; };
  const std::size_t vertices = original_.view.positions.size();
  if (point < vertices) return takes_care(point);
  return std::ranges::any_of(original_.view.triangles[point - vertices], takes_care);
}

// The middles of edges are often the farthest of its samples.
bool KeptPoints::is_near(const Shape& shape, bool at_all_points) const {
  const auto& [a, b, c] = shape.corners;
  const TriangleGrid& grid = grids_.grid_of(shape.triangle);
  const std::uint32_t guess = grids_.number_in_grid(shape.triangle);
  if (at_all_points) return is_within(shape.corners, grid, guess, max_error_mm_);
  const auto is_near = [&](const Point& sum, double share) {
    const Point place = {sum[0] * share, sum[1] * share, sum[2] * share};
    return grid.within(place, squared_mm_, guess).triangle != kNone;
  };
  return is_near(plus(plus(a, b), c), 1.0 / 3) && is_near(plus(a, b), 0.5) &&
         is_near(plus(b, c), 0.5) && is_near(plus(c, a), 0.5);
}

// True if an original triangle, whose centre is near `home`, is near those of the shapes that are
// of its wall.
bool KeptPoints::has_whole_triangle_near(std::uint32_t triangle, std::uint32_t home,
                                         std::span<const Shape> shapes) const {
  std::vector<mesh::Corners> others;
  for (const Shape& shape : shapes) {
    if (original_.sides_of(shape.triangle) == original_.sides_of(home)) {
      others.push_back(shape.corners);
    }
  }
  return is_within(corners_of(original_.view, triangle), others, max_error_mm_);
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
