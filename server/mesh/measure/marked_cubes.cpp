#include "server/mesh/measure/marked_cubes.h"

#include <algorithm>

namespace isomesh::mesh {
namespace {

constexpr double kMostCubes = 512;  // along an axis

void enlarge(Box& box, const Box& by) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    box.low[axis] = std::min(box.low[axis], by.low[axis]);
    box.high[axis] = std::max(box.high[axis], by.high[axis]);
  }
}

}  // namespace

Box box_of(const SurfaceView& surface, const Triangle& triangle) {
  const Point first = to_point(surface.positions[triangle[0]]);
  Box box = {first, first};
  for (const std::uint32_t vertex : triangle) {
    const Point corner = to_point(surface.positions[vertex]);
    enlarge(box, {corner, corner});
  }
  return box;
}

MarkedCubes::MarkedCubes(std::span<const Box> boxes, double reach_mm) : reach_mm_(reach_mm) {
  if (boxes.empty()) return;
  Box all = boxes.front();
  for (const Box& box : boxes) enlarge(all, box);
  low_ = all.low;
  double longest = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    longest = std::max(longest, all.high[axis] - all.low[axis]);
  }
  // Smaller cubes than the boxes would be too many to mark.
  double sum = 0;
  for (const Box& box : boxes) {
    sum += std::max({box.high[0] - box.low[0], box.high[1] - box.low[1], box.high[2] - box.low[2]});
  }
  const double mean = sum / static_cast<double>(boxes.size());
  const double side_mm = std::max({2 * reach_mm, longest / (kMostCubes - 1), mean, 1e-12});
  per_mm_ = 1 / side_mm;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    count_[axis] = static_cast<std::size_t>((all.high[axis] - all.low[axis]) * per_mm_) + 1;
  }
  is_marked_.assign(count_[0] * count_[1] * count_[2], false);
  for (const Box& box : boxes) {
    visit(around(box), [&](std::size_t cube) {
      is_marked_[cube] = true;
      return false;
    });
  }
}

bool MarkedCubes::are_near(const Box& box) const {
  if (is_marked_.empty()) return false;
  return visit(around(box), [&](std::size_t cube) { return bool{is_marked_[cube]}; });
}

// The cubes within reach of a box. None, with low above high, if it is beside all of them.
MarkedCubes::CubeRange MarkedCubes::around(const Box& box) const {
  CubeRange range;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto count = static_cast<double>(count_[axis]);
    const double first = (box.low[axis] - reach_mm_ - low_[axis]) * per_mm_;
    const double last = (box.high[axis] + reach_mm_ - low_[axis]) * per_mm_;
    if (!(first < count) || !(last >= 0)) return {{1, 1, 1}, {0, 0, 0}};
    range.low[axis] = static_cast<std::size_t>(std::max(first, 0.0));
    range.high[axis] = static_cast<std::size_t>(std::min(last, count - 1));
  }
  return range;
}

// Calls is_enough(number) for each cube until it is. Returns true if it ever was.
template <class IsEnough>
bool MarkedCubes::visit(const CubeRange& range, IsEnough is_enough) const {
  for (std::size_t z = range.low[2]; z <= range.high[2]; ++z) {
    for (std::size_t y = range.low[1]; y <= range.high[1]; ++y) {
      for (std::size_t x = range.low[0]; x <= range.high[0]; ++x) {
        if (is_enough((z * count_[1] + y) * count_[0] + x)) return true;
      }
    }
  }
  return false;
}

}  // namespace isomesh::mesh
