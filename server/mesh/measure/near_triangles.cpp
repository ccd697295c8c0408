#include "server/mesh/measure/near_triangles.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "server/mesh/parallel.h"

namespace isomesh::mesh {
namespace {

constexpr double kMostCubes = 512;  // along an axis

using Cube = std::array<std::size_t, 3>;

struct CubeRange {
  Cube low;
  Cube high;  // the last one
};

// Cubes between the points, each marked or not.
class MarkedCubes {
 public:
  MarkedCubes(std::span<const Point> points, double reach_mm) : reach_mm_(reach_mm) {
    Point high = points.front();
    low_ = high;
    for (const Point& point : points) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        low_[axis] = std::min(low_[axis], point[axis]);
        high[axis] = std::max(high[axis], point[axis]);
      }
    }
    double longest = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      longest = std::max(longest, high[axis] - low_[axis]);
    }
    side_mm_ = std::max({2 * reach_mm, longest / (kMostCubes - 1), 1e-12});
    for (std::size_t axis = 0; axis < 3; ++axis) {
      count_[axis] = static_cast<std::size_t>((high[axis] - low_[axis]) / side_mm_) + 1;
    }
    is_marked_.assign(count_[0] * count_[1] * count_[2], false);
    for (const Point& point : points) {
      visit(around(point, point), [&](std::size_t cube) {
        is_marked_[cube] = true;
        return false;
      });
    }
  }

  // True if the box between the corners may be within reach of a point.
  bool are_near(const Point& low, const Point& high) const {
    return visit(around(low, high), [&](std::size_t cube) { return bool{is_marked_[cube]}; });
  }

 private:
  // The cubes within reach of a box. None, with low above high, if it is beside all of them.
  CubeRange around(const Point& low, const Point& high) const {
    CubeRange range;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto last = static_cast<double>(count_[axis] - 1);
      const double first_cube = (low[axis] - reach_mm_ - low_[axis]) / side_mm_;
      const double last_cube = (high[axis] + reach_mm_ - low_[axis]) / side_mm_;
      if (!(first_cube < last + 1) || !(last_cube >= 0)) return {{1, 1, 1}, {0, 0, 0}};
      range.low[axis] = static_cast<std::size_t>(std::clamp(first_cube, 0.0, last));
      range.high[axis] = static_cast<std::size_t>(std::clamp(last_cube, 0.0, last));
    }
    return range;
  }

  // Calls is_enough(number) for each cube until it is. Returns true if it ever was.
  template <class IsEnough>
  bool visit(const CubeRange& range, IsEnough is_enough) const {
    for (std::size_t z = range.low[2]; z <= range.high[2]; ++z) {
      for (std::size_t y = range.low[1]; y <= range.high[1]; ++y) {
        for (std::size_t x = range.low[0]; x <= range.high[0]; ++x) {
          if (is_enough((z * count_[1] + y) * count_[0] + x)) return true;
        }
      }
    }
    return false;
  }

  const double reach_mm_;
  Point low_ = {0, 0, 0};
  double side_mm_ = 1;
  Cube count_ = {1, 1, 1};
  std::vector<bool> is_marked_;
};

}  // namespace

std::vector<Triangle> triangles_near(std::span<const Point> points, double reach_mm,
                                     const SurfaceView& surface, const Context& context) {
  if (points.empty()) return {};
  const MarkedCubes cubes(points, reach_mm);
  const auto is_near = [&](const Triangle& triangle) {
    Point low = to_point(surface.positions[triangle[0]]);
    Point high = low;
    for (const std::uint32_t vertex : triangle) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        low[axis] = std::min<double>(low[axis], surface.positions[vertex][axis]);
        high[axis] = std::max<double>(high[axis], surface.positions[vertex][axis]);
      }
    }
    return cubes.are_near(low, high);
  };
  const std::span<const Triangle> all = surface.triangles;
  std::vector<std::vector<Triangle>> found(chunks_of(all.size()));
  for_chunks(context, all.size(), [&](std::size_t begin, std::size_t end) {
    for (const Triangle& triangle : all.subspan(begin, end - begin)) {
      if (is_near(triangle)) found[begin / kChunk].push_back(triangle);
    }
  });
  std::vector<Triangle> near;
  for (const auto& part : found) near.insert(near.end(), part.begin(), part.end());
  return near;
}

}  // namespace isomesh::mesh
