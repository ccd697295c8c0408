#include "server/mesh/measure/thickness.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "server/mesh/measure/point_triangle.h"
#include "server/mesh/measure/triangle_grid.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh {
namespace {

constexpr std::size_t kTrianglesPerBlock = 256;
// More take longer than a head's own triangles.
constexpr double kParts = 1e6;

Point moved(const Point& from, const Point& direction, double way) {
  return {from[0] + way * direction[0], from[1] + way * direction[1], from[2] + way * direction[2]};
}

// The way along the line from a point to the triangle: T. Möller, B. Trumbore, "Fast, minimum
// storage ray/triangle intersection", 1997. A little wider than the triangle, so that no line
// passes between two. Empty behind the point.
std::optional<double> way_to(const Corners& triangle, const Point& from, const Point& direction) {
  constexpr double kWider = 1e-9;
  const Point ab = minus(triangle[1], triangle[0]);
  const Point ac = minus(triangle[2], triangle[0]);
  const Point across = cross(direction, ac);
  const double scale = dot(ab, across);
  if (scale == 0) return std::nullopt;
  const Point to_from = minus(from, triangle[0]);
  const double b = dot(to_from, across) / scale;
  const Point turned = cross(to_from, ab);
  const double c = dot(direction, turned) / scale;
  const double way = dot(ac, turned) / scale;
  if (!(b >= -kWider && c >= -kWider && b + c <= 1 + kWider && way >= 0)) return std::nullopt;
  return std::abs(way);  // not -0
}

struct Block {
  double thin_area_mm2 = 0;
  double thinnest_mm = std::numeric_limits<double>::infinity();
  Point place = {};

  void add(const Block& other) {
    thin_area_mm2 += other.thin_area_mm2;
    if (other.thinnest_mm >= thinnest_mm) return;
    thinnest_mm = other.thinnest_mm;
    place = other.place;
  }
};

class Walls {
 public:
  Walls(const SurfaceView& surface, double below_mm, double area_mm2, const Context& context)
      : surface_(surface),
        grid_(surface, context),
        below_mm_(below_mm),
        side_mm_(std::max(below_mm / 2, std::sqrt(2 * area_mm2 / kParts))) {
    Reach reach;
    for (const Vec3& position : surface.positions) reach.add({position, position});
    if (reach.is_empty()) return;
    const Point extent = minus(to_point(reach.high), to_point(reach.low));
    thinnest_mm_ = std::sqrt(dot(extent, extent));
  }

  Block measure(std::size_t begin, std::size_t end, const Context& context) {
    Block block;
    for (std::size_t t = begin; t < end; ++t) {
      measure(static_cast<std::uint32_t>(t), context, block);
    }
    return block;
  }

 private:
  void measure(std::uint32_t triangle, const Context& context, Block& block) {
    const Corners corners = corners_of(surface_, triangle);
    const Point normal = normal_of(corners[0], corners[1], corners[2]);
    const double twice_area = std::sqrt(dot(normal, normal));
    if (twice_area == 0) return;
    const Point inward = moved({}, normal, -1 / twice_area);
    const double parts = std::ceil(std::sqrt(twice_area) / side_mm_);
    const double part_area = twice_area / 2 / (parts * parts);
    const auto look = [&](double i, double j) {
      const double b = i / parts;
      const double c = j / parts;
      const Point from = moved(moved(corners[0], minus(corners[1], corners[0]), b),
                               minus(corners[2], corners[0]), c);
      const double thickness = thickness_at(from, inward, triangle);
      if (thickness < below_mm_) block.thin_area_mm2 += part_area;
      block.add({.thinnest_mm = thickness, .place = from});
    };
    for (double i = 0; i < parts; ++i) {
      context.throw_if_stopped();
      for (double j = 0; i + j < parts; ++j) {
        look(i + 1.0 / 3, j + 1.0 / 3);
        if (i + j + 1 < parts) look(i + 2.0 / 3, j + 2.0 / 3);
      }
    }
  }

  // Infinite without an opposite side, and if it is of no interest: not thin, and thicker than
  // another place.
  double thickness_at(const Point& from, const Point& inward, std::uint32_t triangle) {
    constexpr double kFacing = 0.49;      // the cosine of a little more than 60 degrees
    constexpr double kLonger = 1 + 1e-9;  // more than rounding takes
    double most = thinnest_mm_.load(std::memory_order_relaxed);
    double way = std::max(most, below_mm_) * kLonger;
    Point to = moved(from, inward, way);
    std::uint32_t met = TriangleGrid::kNone;
    grid_.visit_along(from, to, [&](std::uint32_t other) {
      if (other == triangle) return;
      const auto its = way_to(corners_of(surface_, other), from, inward);
      if (!its || *its >= way) return;
      way = *its;
      met = other;
      to = moved(from, inward, way * kLonger);
    });
    constexpr double kNothing = std::numeric_limits<double>::infinity();
    if (met == TriangleGrid::kNone) return kNothing;
    const auto [a, b, c] = corners_of(surface_, met);
    const Point normal = normal_of(a, b, c);
    if (dot(normal, inward) < kFacing * std::sqrt(dot(normal, normal))) return kNothing;
    if (is_edge(from, surface_.triangles[triangle], surface_.triangles[met])) return kNothing;
    while (way < most && !thinnest_mm_.compare_exchange_weak(most, way)) {
    }
    return way;
  }

  // True if two sides meet nearby.
  bool is_edge(const Point& from, const Triangle& one, const Triangle& other) const {
    std::vector<Point> common;
    for (const std::uint32_t vertex : one) {
      if (std::ranges::find(other, vertex) == other.end()) continue;
      common.push_back(to_point(surface_.positions[vertex]));
    }
    if (common.empty()) return false;
    const Corners corner = {common.front(), common.back(), common.back()};
    return mesh::squared_distance(from, corner) < below_mm_ * below_mm_;
  }

  const SurfaceView surface_;
  const TriangleGrid grid_;
  const double below_mm_;
  const double side_mm_;                 // of a part of a triangle, about
  std::atomic<double> thinnest_mm_ = 0;  // so far; thicker places are of no interest
};

}  // namespace

Thickness measure_thickness(const SurfaceView& surface, double below_mm, double area_mm2,
                            const Context& context) {
  constexpr double kIndex = 0.3;  // of the time
  Walls walls(surface, below_mm, area_mm2, context.part(0, kIndex));
  std::vector<Block> blocks(chunks_of(surface.triangles.size(), kTrianglesPerBlock));
  const auto measure = [&](std::size_t begin, std::size_t end) {
    blocks[begin / kTrianglesPerBlock] = walls.measure(begin, end, context);
  };
  for_chunks(context.part(kIndex, 1), surface.triangles.size(), measure, kTrianglesPerBlock);
  Block all;
  for (const Block& block : blocks) all.add(block);
  Thickness thickness = {.thin_area_mm2 = all.thin_area_mm2};
  if (std::isfinite(all.thinnest_mm)) {
    thickness.thinnest_mm = all.thinnest_mm;
    thickness.place = all.place;
  }
  return thickness;
}

}  // namespace isomesh::mesh
