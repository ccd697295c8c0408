#include "server/mesh/smooth/flat_triangles.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

namespace isomesh::mesh {
namespace {

using Corners = std::array<Vec3*, 3>;

bool is_without_area(const Corners& corners) {
  return has_no_area(*corners[0], *corners[1], *corners[2]);
}

// A layer and the next, whose vertices its triangles name.
struct TwoLayers {
  TwoLayers(std::ptrdiff_t layer, const SmoothedLayers& layers)
      : low(layers.view(layer)),
        high(layer + 1 < layers.count() ? layers.view(layer + 1) : LayerView()) {}

  bool is_high(std::uint32_t vertex) const { return vertex >= low.end(); }
  std::size_t index(std::uint32_t vertex) const {
    return vertex - (is_high(vertex) ? low.end() : low.first());
  }
  Vec3* at(std::uint32_t vertex) const {
    return (is_high(vertex) ? high : low).positions + index(vertex);
  }
  Corners corners(const Triangle& triangle) const {
    return {at(triangle[0]), at(triangle[1]), at(triangle[2])};
  }

  LayerView low;
  LayerView high;
};

// Moves a vertex by about the rounding of its position, such that its triangles have areas. Returns
// false if there is no such move, or if the vertex is not free.
bool nudge(std::size_t index, std::ptrdiff_t layer, const SmoothedLayers& layers) {
  const LayerView own = layers.view(layer);
  Vec3* const vertex = own.positions + index;
  std::vector<Corners> around;
  std::int64_t next_minus_previous = 0;  // not 0 on the boundary of a manifold
  float largest = 0;
  for (std::ptrdiff_t n = std::max<std::ptrdiff_t>(0, layer - 1); n <= layer; ++n) {
    const TwoLayers two(n, layers);
    for (const Triangle& triangle : two.low.triangles()) {
      const Corners corners = two.corners(triangle);
      const std::size_t corner = std::ranges::find(corners, vertex) - corners.begin();
      if (corner == corners.size()) continue;
      around.push_back(corners);
      next_minus_previous += std::int64_t{triangle[(corner + 1) % 3]} - triangle[(corner + 2) % 3];
      for (const Vec3* each : corners) {
        for (const float at : *each) largest = std::max(largest, std::abs(at));
      }
    }
  }
  const std::size_t number = own.first() + index;
  if (next_minus_previous != 0 || own.mesh->is_on_border(number) || own.mesh->is_on_line(number)) {
    return false;
  }
  const Vec3 before = *vertex;
  for (const float step : {largest * 0x1p-22F, -largest * 0x1p-22F}) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      (*vertex)[axis] = before[axis] + step;
      if (std::ranges::none_of(around, is_without_area)) return true;
      *vertex = before;
    }
  }
  return false;
}

}  // namespace

void list_flat(std::ptrdiff_t layer, const SmoothedLayers& layers) {
  const TwoLayers two(layer, layers);
  for (const Triangle& triangle : two.low.triangles()) {
    if (!is_without_area(two.corners(triangle))) continue;
    for (const std::uint32_t vertex : triangle) {
      layers.result(two.is_high(vertex) ? layer + 1 : layer)
          .flat.push_back(static_cast<std::uint32_t>(two.index(vertex)));
    }
  }
}

void put_back(const Vec3* extracted, std::ptrdiff_t layer, const SmoothedLayers& layers) {
  SmoothedLayer& result = layers.result(layer);
  if (result.flat.empty()) return;
  const LayerView view = layers.view(layer);
  for (const std::uint32_t vertex : result.flat) view.positions[vertex] = extracted[vertex];
  result.flat = {};
  result.was_put_back = true;
  result.displacement = {};
  for (std::size_t v = 0; v < view.vertices(); ++v) {
    result.displacement.add(extracted[v], view.positions[v]);
  }
}

void measure_again(std::ptrdiff_t layer, bool SmoothedLayer::*was_moved,
                   const SmoothedLayers& layers) {
  SmoothedLayer& result = layers.result(layer);
  const bool has_next = layer + 1 < layers.count();
  if (!(result.*was_moved) && !(has_next && layers.result(layer + 1).*was_moved)) return;
  result.after = {};
  const LayerView view = layers.view(layer);
  for (std::size_t v = 0; v < view.vertices(); ++v)
    result.after.add_vertex(load(view.positions[v]));
  layers.add_triangles(layer, &SmoothedLayer::after);
}

void nudge_flat(std::ptrdiff_t layer, const SmoothedLayers& layers) {
  if (!layers.result(layer).after.has_flat()) return;
  const TwoLayers two(layer, layers);
  for (const Triangle& triangle : two.low.triangles()) {
    if (!is_without_area(two.corners(triangle))) continue;
    for (const std::uint32_t vertex : triangle) {
      const std::ptrdiff_t of_vertex = two.is_high(vertex) ? layer + 1 : layer;
      if (!nudge(two.index(vertex), of_vertex, layers)) continue;
      layers.result(of_vertex).was_nudged = true;
      break;
    }
  }
}

void FlatTriangles::go_on(std::ptrdiff_t moved) {
  const std::ptrdiff_t count = layers_.count();
  // How many have ended that still wait for so many further layers.
  const auto without = [&](std::ptrdiff_t waiting) {
    return moved == count ? count : std::max<std::ptrdiff_t>(0, moved - waiting);
  };
  for (; nudged_ < without(3); ++nudged_) nudge_flat(nudged_, layers_);
  for (; ended_ < without(4); ++ended_) {
    measure_again(ended_, &SmoothedLayer::was_nudged, layers_);
  }
}

}  // namespace isomesh::mesh
