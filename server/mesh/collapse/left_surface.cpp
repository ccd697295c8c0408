#include "server/mesh/collapse/left_surface.h"

#include <algorithm>
#include <iterator>
#include <numeric>
#include <string>

#include "server/mesh/parallel.h"

namespace isomesh::mesh::collapse {
namespace {

void make_set(std::vector<WallSides>& walls) {
  std::ranges::sort(walls);
  walls.erase(std::unique(walls.begin(), walls.end()), walls.end());
}

}  // namespace

LeftSurface::LeftSurface(const Mesh& mesh, std::span<const WallSides> sides, const History& history,
                         const Context& context) {
  find_walls(sides, context);
  find_left(mesh, history, context);
  make_slots();
  find_corners();
}

void LeftSurface::find_walls(std::span<const WallSides> sides, const Context& context) {
  // Neighbours are of one wall as a rule, so few are sorted.
  std::vector<std::vector<WallSides>> found(chunks_of(sides.size()));
  for_chunks(context, sides.size(), [&](std::size_t begin, std::size_t end) {
    std::vector<WallSides>& walls = found[begin / kChunk];
    std::ranges::unique_copy(sides.subspan(begin, end - begin), std::back_inserter(walls));
    make_set(walls);
  });
  for (const auto& walls : found) walls_.insert(walls_.end(), walls.begin(), walls.end());
  make_set(walls_);
  wall_of_.resize(sides.size());
  for_each(context, sides.size(), [&](std::size_t t) {
    const auto wall = std::ranges::lower_bound(walls_, sides[t]);
    wall_of_[t] = static_cast<std::uint32_t>(wall - walls_.begin());
  });
  if (walls_.empty()) walls_.emplace_back();
}

void LeftSurface::find_left(const Mesh& mesh, const History& history, const Context& context) {
  const std::size_t count = mesh.positions.size();
  kept_.resize(count);
  for_each(context, count,
           [&](std::size_t v) { kept_[v] = history.kept(static_cast<std::uint32_t>(v)); });
  number_.assign(count, kNone);
  const auto corners_left = [&](const Triangle& triangle) {
    return Triangle{kept_[triangle[0]], kept_[triangle[1]], kept_[triangle[2]]};
  };
  const auto is_left = [](const Triangle& corners) {
    return corners[0] != corners[1] && corners[1] != corners[2] && corners[2] != corners[0];
  };
  const auto triangles = std::ranges::count_if(
      mesh.triangles, [&](const Triangle& each) { return is_left(corners_left(each)); });
  triangles_.reserve(static_cast<std::size_t>(triangles));
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Triangle corners = corners_left(mesh.triangles[t]);
    if (!is_left(corners)) continue;
    for (const std::uint32_t v : corners) number_[v] = 0;
    triangles_.push_back({corners, {wall_of(t), 0, 0}});
  }
  left_.reserve(count - static_cast<std::size_t>(std::ranges::count(number_, kNone)));
  for (std::uint32_t v = 0; v < count; ++v) {
    if (number_[v] == kNone) continue;
    number_[v] = static_cast<std::uint32_t>(left_.size());
    left_.push_back(v);
  }
  for (LeftTriangle& triangle : triangles_) {
    for (std::uint32_t& corner : triangle.corners) corner = number_[corner];
  }
}

void LeftSurface::make_slots() {
  std::vector<std::size_t> begins(left_.size() + 1, 0);
  for (const LeftTriangle& triangle : triangles_) {
    for (const std::uint32_t n : triangle.corners) ++begins[n + 1];
  }
  std::partial_sum(begins.begin(), begins.end(), begins.begin());
  std::vector<std::uint32_t> walls(begins.back());
  std::vector<std::uint32_t> counts(left_.size(), 0);
  for (const LeftTriangle& triangle : triangles_) {
    const std::uint32_t wall = triangle.slots[0];
    for (const std::uint32_t n : triangle.corners) {
      const auto begin = walls.begin() + static_cast<std::ptrdiff_t>(begins[n]);
      const auto end = begin + counts[n];
      if (std::find(begin, end, wall) != end) continue;
      *end = wall;
      ++counts[n];
    }
  }
  first_slot_.reserve(left_.size() + 1);
  slot_walls_.reserve(std::accumulate(counts.begin(), counts.end(), std::size_t{0}));
  for (std::size_t n = 0; n < left_.size(); ++n) {
    first_slot_.push_back(static_cast<std::uint32_t>(slot_walls_.size()));
    for (std::size_t k = 0; k < counts[n]; ++k) slot_walls_.push_back(walls[begins[n] + k]);
  }
  first_slot_.push_back(static_cast<std::uint32_t>(slot_walls_.size()));
  for (LeftTriangle& triangle : triangles_) {
    const std::uint32_t wall = triangle.slots[0];
    for (std::size_t i = 0; i < 3; ++i) triangle.slots[i] = slot_of(triangle.corners[i], wall);
  }
}

void LeftSurface::find_corners() {
  if (triangles_.size() > kNone / 3) {
    throw Error(ErrorCode::kTooLarge,
                "the simplified surface has " + std::to_string(triangles_.size()) +
                    " triangles; more than 32 bits can number the corners of");
  }
  first_corner_.assign(slot_walls_.size() + 1, 0);
  for (const LeftTriangle& triangle : triangles_) {
    for (const std::uint32_t slot : triangle.slots) ++first_corner_[slot];
  }
  std::partial_sum(first_corner_.begin(), first_corner_.end(), first_corner_.begin());
  corners_.resize(3 * triangles_.size());
  for (auto corner = static_cast<std::uint32_t>(corners_.size()); corner-- > 0;) {
    corners_[--first_corner_[triangles_[corner / 3].slots[corner % 3]]] = corner;
  }
}

std::uint32_t LeftSurface::slot_of(std::uint32_t number, std::uint32_t wall) const {
  for (std::uint32_t slot = first_slot_[number]; slot < first_slot_[number + 1]; ++slot) {
    if (slot_walls_[slot] == wall) return slot;
  }
  return kNone;
}

std::uint32_t LeftSurface::slot_of_kept(std::uint32_t vertex, std::uint32_t wall) const {
  const std::uint32_t number = number_[kept_[vertex]];
  return number == kNone ? kNone : slot_of(number, wall);
}

}  // namespace isomesh::mesh::collapse
